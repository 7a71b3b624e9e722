import numpy as np
import semismooth as ss

# Near the contact of two cylinders: blocks of 2 × size by size with their gap x² / radius; all in units that belong together.
radius, size, force, pull, friction, a, c = 8.0, 32.0, 10.0, 16 * 0.05851, 0.2, 0.68078, 0.49651


def block(n):
    lines = list(a * np.arange(3 * n // 2 + 1) / n)
    while lines[-1] < size:
        lines.append(lines[-1] + (lines[-1] - lines[-2]) * (1 + 2.4 / n))
    lines = np.array(lines[:-2] + [size])
    x, y = np.meshgrid(np.concatenate([-lines[:0:-1], lines]), lines)
    return np.column_stack([x.ravel(), y.ravel()]), ss.Mesh.rectangle([0, 0], [1, 1], [2 * len(lines) - 2, len(lines) - 1]).cells[0][1]


def fit(x, p, width):
    """Half the width and the height of p = height √(1 − x² / width²)."""
    slope, start = np.polyfit(x[abs(x) < 0.8 * width] ** 2, p[abs(x) < 0.8 * width] ** 2, 1)
    return np.sqrt(-start / slope), np.sqrt(start)


print(f"                  a        p0      c\nHertz, Cattaneo   {a}  9.3514  {c}")
for n in [4, 8, 16]:
    (upper, above), (lower, below) = block(n), block(n + 1)
    mesh = ss.Mesh(np.vstack([upper, lower * [1, -1]]), {"quad": np.vstack([above, below[:, ::-1] + len(upper)])})
    for name, side, height, far in [("slave", -1, 0, 2 * a), ("master", 1, 0, 3 * a), ("top", 1, size, size), ("base", -1, -size, size)]:
        mesh = mesh.with_boundary(name, lambda x, n: (n[:, 1] * side > 0.9) & (x[:, 1] == height) & (abs(x[:, 0]) < far))
    body = ss.Body(mesh, ss.Material(200.0, 0.3), supports={"base": 0.0}, floating=True)
    press = body.traction("top", [0.0, -force / (2 * size)])
    # With the couple that lets the pull pass through the point of contact.
    shear = body.traction("top", lambda x: [pull / (2 * size), 1.5 * pull * x[0] / size**2])
    problem = ss.ContactProblem(body, "slave", ss.Mortar("master", gap=lambda x: x[0] ** 2 / radius), friction, load=press, rate=shear)
    pressed = problem.solve()
    pulled = ss.evolve(problem, pressed, [0.25, 0.5, 0.75, 1.0])[-1].solution
    x, areas = problem.points[:, 0], problem.areas
    width, height = fit(x, pressed.pressures / areas, a)
    # What friction could bear more: it grows inwards from the rim of the sticking zone.
    left = (friction * pulled.pressures - abs(pulled.tractions[:, 0])) / areas
    print(f"{n:2} cells in a     {width:.5f}  {height:.4f}  {fit(x, left, c)[0]:.5f}")
