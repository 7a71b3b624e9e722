import numpy as np
import semismooth as ss

# Half a cylinder on half a block, cut by the plane x = 0; N, mm, MPa.
radius, force, a = 50.0, 35e3, 6.2146


def steps(n, end):  # Of a / n, then ever longer ones.
    lines = list(a * np.arange(3 * n // 2 + 1) / n)
    while lines[-1] < end:
        lines.append(lines[-1] + (lines[-1] - lines[-2]) * (1 + 2.4 / n))
    return np.array(lines[:-2] + [end])


def solved(n, friction):
    # Arcs around the point of contact, from the axis to the circle, between that point and the top; below, a grid.
    angles, across = steps(n, np.pi * radius)[1:-1, None] / radius, np.linspace(0, 1, n + 1)
    tilt, arc = across * (np.pi - angles) / 2, 2 * radius * np.sin(angles / 2)
    x, y = np.meshgrid(steps(n, 100.0), -steps(n, 200.0)[::-1])
    parts = [(arc * np.sin(tilt), arc * np.cos(tilt)), ([0, 0], [0, 2 * radius]), (x, y)]
    points = np.vstack([np.column_stack([np.ravel(x), np.ravel(y)]) for x, y in parts])
    low = (n + 1) * len(angles)
    fans = [[low, j + 1, j] for j in range(n)] + [[j, j + 1, low + 1] for j in range(low - n - 1, low - 1)]
    grids = [ss.Mesh.rectangle([0, 0], [1, 1], [s[1] - 1, s[0] - 1]).cells[0][1] for s in (tilt.shape, x.shape)]
    mesh = ss.Mesh(points, [("quad", grids[0]), ("triangle", fans), ("quad", grids[1] + low + 2)], nodes={"top": [low + 1]})
    mesh = mesh.with_cells("block", lambda x: x[:, 1] < 0).with_nodes("axis", lambda x: x[:, 0] == 0)
    mesh = mesh.with_boundary("cylinder", lambda x, normal: (x[:, 1] > 0) & (x[:, 0] < 3 * a) & (normal[:, 1] < -0.5))
    mesh = mesh.with_boundary("surface", lambda x, normal: (x[:, 1] == 0) & (x[:, 0] < 2 * a))
    mesh = mesh.with_boundary("base", lambda x, normal: x[:, 1] < -199)
    options = {"materials": {"block": ss.Material(70e3, 0.3)}, "supports": {"base": 0.0, "axis": [0.0, None]}, "floating": True}
    body = ss.Body(mesh, ss.Material(210e3, 0.3), **options)
    return ss.ContactProblem(body, "surface", "cylinder", friction, load=body.nodal_force("top", [0.0, -force / 2])).solve()


for friction, published in [(None, "Hertz            6.215  3585.4"), (0.1, "MARC, F = 0.1           3542.7  -1.30264")]:
    print(("" if friction else "                     a     p(B)      v(B)\n") + published)
    for n in [8, 16, 32]:
        found = solved(n, friction)
        x, p = found.problem.points[:, 0], found.pressures / found.problem.areas
        slope, start = np.polyfit(x[x < 0.8 * a] ** 2, p[x < 0.8 * a] ** 2, 1)
        print(f"{n:2} cells in a    {np.sqrt(-start / slope):6.3f}  {p[0]:6.1f}  {found.displacements[found.problem.nodes[0], 1]:8.5f}")
open("cylinder.svg", "w").write(solved(8, 0.1).to_svg(magnification=5.0))
