import semismooth as ss

mesh = ss.Mesh.rectangle([0.0, 0.0], [2.0, 1.0], [16, 8])
material = ss.Material(young=1.0, poisson=0.3)
body = ss.Body(mesh, material, supports={"top": [0.0, -0.02]})
ground = ss.Foundation.plane([0.0, 0.0], [0.0, 1.0])
rate = body.motion("top", [0.02, None])
problem = ss.ContactProblem(body, "bottom", ground, 0.2, rate=rate)
corners = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0]
ways = zip(corners, corners[1:])
levels = [a + (b - a) * k / 8 for a, b in ways for k in range(1, 9)]
dissipated = 0.0
for step in ss.evolve(problem, problem.solve(0.0), levels):
    dissipated += step.dissipated
    if abs(step.level) == 1.0:
        counts, force = step.solution.counts, step.solution.resultant[1]
        print(f"top {0.02 * step.level:+.3f}: {counts}, force {force:+.5f}, "
              f"dissipated {dissipated:.3e}")
