import semismooth as ss

mesh = ss.Mesh.rectangle([0.0, 0.0], [2.0, 1.0], [16, 8])
material = ss.Material(young=1.0, poisson=0.3)
body = ss.Body(mesh, material, supports={"top": [0.0, -0.02]})
ground = ss.Foundation.plane([0.0, 0.0], [0.0, 1.0])
rate = body.motion("top", [0.05, None])
problem = ss.ContactProblem(body, "bottom", ground, 0.4, rate=rate)
print(f"{body.num_free} displacements, {problem.num_contacts} contact nodes")

branch = ss.follow(problem, problem.solve(0.0), parameter_range=(0.0, 1.0))
changes, folds = len(branch.transitions), len(branch.folds)
print(f"{changes} changes of state up to α = 1, {folds} folds")
end = problem.at(branch.points[-1])
print("at α = 1: {:2} open, {:2} stick, {:2} slip,".format(*end.counts))
print(f"  pressure {end.resultant[0]:.5f}, friction {abs(end.resultant[1]):.5f}")
