import numpy as np
import semismooth as ss

# A hub pressed on a shaft of the same length, 40 mm, with free ends; N, mm, MPa.
young, poisson, c, b, half, fit = 210e3, 0.3, 25.0, 50.0, 20.0, 0.025
pressure = young * fit * (b**2 - c**2) / (2 * c * b**2)
widening = 2 * pressure * c**2 * b / (young * (b**2 - c**2))
print("            pressure    outer radius grows by")
print(f"Lamé        {pressure:8.3f}    {widening:.6f}")
for n in [4, 8, 16]:
    shaft = ss.Mesh.rectangle([0.0, 0.0], [c, half], [n, n])
    hub = ss.Mesh.rectangle([c, 0.0], [b, half], [n, 3 * n // 2])
    (kind, inner), (_, outer) = shaft.cells[0], hub.cells[0]
    points = np.vstack([shaft.points, hub.points])
    mesh = (
        ss.Mesh(points, {kind: np.vstack([inner, outer + shaft.num_nodes])})
        .with_boundary("shaft", lambda x, normal: (normal[:, 0] > 0.5) & (x[:, 0] < c + 1e-9))
        .with_boundary("bore", lambda x, normal: (normal[:, 0] < -0.5) & (x[:, 0] > c - 1e-9))
        .with_boundary("middle", lambda x, normal: normal[:, 1] < -0.5)
    )
    body = ss.Body(mesh, ss.Material(young, poisson), supports={"middle": [None, 0.0]}, plane="axisymmetric")
    problem = ss.ContactProblem(body, "shaft", ss.Mortar("bore", gap=-fit), None)
    found = problem.solve()
    mean = found.pressures.sum() / problem.areas.sum()
    grown = found.displacements[np.isclose(points[:, 0], b), 0].mean()
    print(f"{n:2} cells    {mean:8.3f}    {grown:.6f}")
