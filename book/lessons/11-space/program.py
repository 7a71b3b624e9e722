import numpy as np
import semismooth as ss

M = [[3, 0, 0, -1, 0, 0], [0, 1, 0, 0, 1, 0], [0, 0, 3, 0, 0, -1],
     [-1, 0, 0, 3, 0, 0], [0, 1, 0, 0, 1, 0], [0, 0, -1, 0, 0, 3]]
q = [-1.0, 0.1, 0.9, -1.0, 0.1, -0.3]
rod = ss.solve_friction(np.array(M, dtype=float), q, [0.5, 0.5])
print(f"rod: solved {rod.solved}")
for foot, r in enumerate(np.reshape(rod.x, (2, 3)), 1):
    print(f"  foot {foot}: r_N = {r[0]:.4f}, |r_T| = {np.hypot(r[1], r[2]):.4f}")

nearest = ss.solve_cone((np.eye(3), [-1.0, -3.0, 0.0]), [("second-order", 3)])
print("projection on the cone: x = ({:.4f}, {:.4f})".format(*nearest.x))

times = (np.diag([2.0, 1.0]), [1.0, 3.0])
roads = ss.solve_vi(times, [0.0, 0.0], lower=[0, 0], E=[[1.0, 1.0]], d=[4.0])
print("roads: x = ({:.4f}, {:.4f})".format(*roads.x))
