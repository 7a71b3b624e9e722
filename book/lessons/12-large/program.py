import semismooth as ss

for n in [4, 8, 16]:
    mesh = ss.Mesh.block([0.0, 0.0, 0.0], [2.0, 2.0, 1.0], [n, n, n // 2])
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={"left": [0.0, 0.0, 0.0]})
    load = body.traction("top", [0.0, 0.0, -0.02]) + body.traction("right", [0.02, 0.01, 0.0])
    ground = ss.Foundation.plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    problem = ss.ContactProblem(body, "bottom", ground, 0.5, load=load, form="reduced")
    found = problem.solve()
    assert max(found.residuals.values()) < 1e-10
    counts = "{:2} open, {:3} stick, {:3} slip".format(*found.counts)
    print(f"{body.num_free:5} displacements, {problem.num_contacts:3} contact nodes: {counts}")
