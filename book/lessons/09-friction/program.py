import semismooth as ss

mesh = ss.Mesh.rectangle([0.0, 0.0], [2.0, 1.0], [16, 8])
body = ss.Body(mesh, ss.Material(young=1.0, poisson=0.3), supports={"top": [0.0, -0.02]})
ground = ss.Foundation.plane([0.0, 0.0], [0.0, 1.0])
problem = ss.ContactProblem(body, "bottom", ground, 0.4, rate=body.motion("top", [0.05, None]))
print(f"{body.num_free} displacements, {problem.num_contacts} contact nodes")

branch = ss.follow(problem, problem.solve(0.0), parameter_range=(0.0, 1.0))
print(f"{len(branch.transitions)} changes of state up to α = 1, {len(branch.folds)} folds")
end = problem.at(branch.points[-1])
print("at α = 1: {:2} open, {:2} stick, {:2} slip, pressure {:.5f}, friction {:.5f}".format(
    *end.counts, end.resultant[0], abs(end.resultant[1])))
