import semismooth as ss

mesh = ss.Mesh.rectangle([0.0, 0.0], [2.0, 1.0], [16, 8])
body = ss.Body(mesh, ss.Material(young=1.0, poisson=0.3), supports={"top": [0.0, -0.02]})
ground = ss.Foundation.plane([0.0, 0.0], [0.0, 1.0])
problem = ss.ContactProblem(body, "bottom", ground, 0.2, rate=body.motion("top", [0.02, None]))
corners = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0]
levels = [a + (b - a) * k / 8 for a, b in zip(corners, corners[1:]) for k in range(1, 9)]
dissipated = 0.0
for step in ss.evolve(problem, problem.solve(0.0), levels):
    dissipated += step.dissipated
    if abs(step.level) == 1.0:
        print(f"top {0.02 * step.level:+.3f}: {step.solution.counts}, "
              f"force {step.solution.resultant[1]:+.5f}, dissipated {dissipated:.3e}")
