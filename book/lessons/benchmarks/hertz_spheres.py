import numpy as np
import semismooth as ss

# Two equal spheres pressed together by h are one on a rigid plane, pressed by h / 2; mm, MPa.
radius, young, poisson = 50.0, 20e3, 0.3
modulus = young / (1 - poisson**2)
print("h     cells in a        a        p0    p0 by the force")
for h in [4.0, 1.0, 0.25]:
    a = np.sqrt(radius * h / 2)
    print(f"{h:<4}  Hertz       {a:8.4f}  {modulus / np.pi * np.sqrt(2 * h / radius):8.2f}")
    for n in [4, 8, 16]:
        lines = list(a * np.arange(1, 3 * n // 2 + 1) / n)
        while lines[-1] < np.pi / 2 * radius:
            lines.append(lines[-1] + (lines[-1] - lines[-2]) * (1 + 2.4 / n))
        angles, across = (np.array(lines) * np.pi / 2 / lines[-1])[:, None], np.linspace(0, 1, n + 1)
        tilt, arc, flat = across * (np.pi - angles) / 2, 2 * radius * np.sin(angles / 2), (2 * angles / np.pi) ** 2
        x = (1 - flat) * arc * np.sin(tilt) + flat * radius * np.sin(angles) * across
        y = (1 - flat) * arc * np.cos(tilt) + flat * radius * (1 - np.cos(angles))
        points = np.vstack([[[0, 0]], np.column_stack([x.ravel(), y.ravel()])])
        quads = ss.Mesh.rectangle([0, 0], [1, 1], [n, len(lines) - 1]).cells[0][1] + 1
        mesh = ss.Mesh(points, {"quad": quads, "triangle": [[0, j + 2, j + 1] for j in range(n)]})
        mesh = mesh.with_boundary("surface", lambda x, normal: (normal[:, 1] < -0.5) & (x[:, 0] < 2 * a))
        mesh = mesh.with_boundary("top", lambda x, normal: x[:, 1] > radius - 1e-9)
        body = ss.Body(mesh, ss.Material(young, poisson), supports={"top": [None, -h / 2]}, plane="axisymmetric")
        found = ss.ContactProblem(body, "surface", ss.Foundation.plane([0.0, 0.0], [0.0, 1.0]), None).solve()
        x, p, load = found.problem.points[:, 0], found.pressures / found.problem.areas, found.pressures.sum()
        inside = (x > 0.2 * a) & (x < 0.8 * a)
        slope, start = np.polyfit(x[inside] ** 2, p[inside] ** 2, 1)
        by_force = np.cbrt(6 * load * modulus**2 / (np.pi**3 * radius**2))
        print(f"      {n:5}       {np.sqrt(-start / slope):8.4f}  {np.sqrt(start):8.2f}   {by_force:8.2f}")
