import numpy as np
import semismooth as ss

# A square plate (m, Pa), half of a symmetric one: pressed from above, pushed from the left, held at its corner by the ground.
places, published = np.array([0.0, 1.25, 5.0, 7.5, 11.25]) * 1e-3, [2.86, 2.72, 2.28, 1.98, 1.54]
print("slip in 1e-5 m at x =    0     1.25      5      7.5    11.25 mm")
print("GRECO             " + "".join(f"{u:8.2f}" for u in published))
for n in [16, 32, 64]:
    mesh = ss.Mesh.rectangle([0.0, 0.0], [0.04, 0.04], [n, n])
    mesh = mesh.with_nodes("corner", lambda x: (x[:, 0] == 0.04) & (x[:, 1] == 0))
    body = ss.Body(mesh, ss.Material(1.3e11, 0.2), supports={"right": [0.0, None], "corner": 0.0})
    load = body.traction("top", [0.0, -5e7]) + body.traction("left", [15e7, 0.0])
    found = ss.ContactProblem(body, "bottom", ss.Foundation.plane([0.0, 0.0], [0.0, 1.0]), 1.0, load=load).solve()
    slips = np.interp(places, found.problem.points[:, 0], abs(found.slips[:, 0]))
    print(f"{n:2} × {n:2} cells     " + "".join(f"{1e5 * u:8.3f}" for u in slips))
