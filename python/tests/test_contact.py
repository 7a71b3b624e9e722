"""Bodies in contact: against reference numbers, an assembly of our own, energies and the conditions that define a solution."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import semismooth as ss

DATA = Path(__file__).parents[2] / "tests" / "data"


def weakening(slip, zeta):
    """Haslinger, Kučera and Vlach (2008): ζ F(ξ), ξ in metres."""
    return zeta * (0.1 + 0.3 * np.exp(-((slip / 0.005) ** 2)))


def bar(nx, friction=weakening, form="condensed"):
    mesh = ss.Mesh.rectangle([0, 0], [10, 1], [nx, nx // 10])
    mesh = mesh.with_boundary("pressed hard", lambda x, n: (n[:, 1] > 0.5) & (x[:, 0] > 8))
    mesh = mesh.with_boundary("pressed", lambda x, n: (n[:, 1] > 0.5) & (x[:, 0] <= 8))
    body = ss.Body(mesh, ss.Material(211.9, 0.277), supports={"left": 0.0})
    load = body.traction("pressed hard", [0, -0.5]) + body.traction("pressed", lambda x: [0, -0.02]) + body.traction("right", [0.57, 0])
    ground = ss.Foundation.plane([0, 0], [0, 1])
    law = ss.Friction.function(friction) if callable(friction) else friction
    return ss.ContactProblem(body, "bottom", ground, law, load=load, form=form)


@pytest.mark.parametrize(("nx", "name", "folds"), [(20, "20x2", [1.398827735096, 2.724786266795]), (40, "40x4", [1.375501835970, 2.725414553670])])
def test_the_bar_has_three_solutions(nx, name, folds):
    problem = bar(nx)
    start = problem.solve(0.9)
    branch = ss.follow(problem, start, parameter_range=(0.9, 3.2), targets=[1.4])
    np.testing.assert_allclose(sorted(f.parameter for f in branch.folds), folds, rtol=1e-9)
    assert sorted(f.kind for f in branch.folds) == ["kink", "smooth"]
    found = [x for x in branch.points if x[-1] == 1.4]
    assert len(found) == 3
    expected = [json.loads((DATA / "bar2d.json").read_text())[name][f"solution{k}"] for k in (1, 2, 3)]
    slips = [problem.at(x).slips[-1, 0] for x in found]
    for x, reference in zip([found[k] for k in np.argsort(slips)], expected):
        solution = problem.at(x)
        u, force = np.reshape(reference["u"], (-1, 2)), np.reshape(reference["l"], (-1, 2))
        np.testing.assert_allclose(problem.areas, reference["area"], rtol=1e-12)
        own = np.column_stack([solution.penetrations, solution.slips])
        np.testing.assert_allclose(own, u, rtol=0, atol=1e-9 * abs(u).max())
        own = np.column_stack([solution.pressures, solution.tractions])
        np.testing.assert_allclose(own, force, rtol=0, atol=1e-9 * abs(force).max())


def pressed(friction, **more):
    """A block pressed on the ground by a traction of 0.01 an area, and sheared."""
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [16, 8])
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={"left": 0.0})
    load = body.traction("top", [0, -0.01]) + body.traction("right", [0.002, 0])
    return ss.ContactProblem(body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), friction, load=load, **more)


def test_the_bound_of_a_coulomb_solution_gives_that_solution():
    coulomb = pressed(0.3).solve()
    assert 0 < coulomb.counts[2] < len(coulomb.states)
    given = pressed(ss.GivenBound(0.3 * coulomb.pressures)).solve()
    np.testing.assert_allclose(given.pressures, coulomb.pressures, rtol=0, atol=1e-12)
    np.testing.assert_allclose(given.tractions, coulomb.tractions, rtol=0, atol=1e-12)
    np.testing.assert_allclose(given.slips, coulomb.slips, rtol=0, atol=1e-10)
    # With the bound 0 there is no friction; with a large one all nodes in contact stick.
    free = pressed(ss.GivenBound(0.0)).solve()
    np.testing.assert_allclose(free.tractions, 0, atol=1e-15)
    np.testing.assert_allclose(free.pressures, pressed(None).solve().pressures, atol=1e-12)
    assert pressed(ss.GivenBound(1.0)).solve().counts[2] == 0
    with pytest.raises(ss.SemismoothError, match="-1"):
        pressed(ss.GivenBound(-1.0))
    with pytest.raises(ValueError, match="3 bounds of friction for 16 contact nodes"):
        pressed(ss.GivenBound(np.ones(3)))


def test_contact_forces_live_on_nodes_dual_cells_or_partitions():
    nodal = pressed(0.3)
    coarse = ss.Mesh.rectangle([0, 0], [2, 1], [6, 1]), "bottom"
    for multipliers, degree, count in [
        ("nodal", "constant", 16), ("dual cells", "constant", 16), (2, "constant", 8), (4, "constant", 4), (4, "linear", 8),
        (coarse, "constant", 6), (coarse, "continuous", 7), (["bottom"], "linear", 2),
    ]:
        problem = pressed(0.3, multipliers=multipliers, degree=degree)
        assert problem.num_contacts == count
        # The node at the support has no multiplier: the dual cells of others cover its part of the facets.
        np.testing.assert_allclose(problem.areas.sum(), 2.0 if multipliers != "nodal" else nodal.areas.sum(), rtol=1e-12)
        solution = problem.solve()
        assert max(solution.residuals.values()) < 1e-12
        slipping = [s.startswith("slip") for s in solution.states]
        np.testing.assert_allclose(abs(solution.tractions[slipping, 0]), 0.3 * solution.pressures[slipping], rtol=1e-10)
        # With smaller elements the means of normal displacements tend to those of nodes.
        if count > 2:
            assert abs(solution.resultant[0] - nodal.solve().resultant[0]) < 0.1 * nodal.solve().resultant[0]
    half = ss.Mesh.rectangle([0, 0], [1, 1], [2, 1]), "bottom"
    for wrong, error, what in [
        ("nodes", ValueError, "nodes"), (0.5, ValueError, "0.5"), (0, ss.SemismoothError, "k = 0"), (17, ss.SemismoothError, "larger"),
        (half, ss.SemismoothError, "no element covers"), (["top"], ss.SemismoothError, "top"),
    ]:
        with pytest.raises(error, match=what):
            pressed(0.3, multipliers=wrong)
    with pytest.raises(ValueError, match="quadratic"):
        pressed(0.3, multipliers=2, degree="quadratic")


def stiffness(mesh, young, poisson):
    """The stiffness matrix of all displacements, plane strain or space, assembled cell by cell with Gauss points."""
    d, points = mesh.dimension, mesh.points
    gauss = np.array([-1, 1]) / np.sqrt(3)
    lame, mu = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    total = np.zeros((d * len(points),) * 2)
    box = {4: [[-1, -1], [1, -1], [1, 1], [-1, 1]], 8: [[a, b, c] for c in (-1, 1) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]}
    for kind, cells in mesh.cells:
        for nodes in cells:
            x = points[nodes]
            if kind in ("triangle", "tetra"):
                rules = [(np.vstack([-np.ones(d), np.eye(d)]), 1 / (2 if d == 2 else 6))]
            else:
                corners = np.array(box[len(nodes)])
                rules = []
                for xi in np.stack(np.meshgrid(*[gauss] * d), -1).reshape(-1, d):
                    factors = (1 + corners * xi) / 2
                    parts = [np.prod(np.delete(factors, k, axis=1), axis=1) * corners[:, k] / 2 for k in range(d)]
                    rules.append((np.column_stack(parts), 1.0))
            element = np.zeros((len(nodes), d, len(nodes), d))
            for reference, weight in rules:
                jacobian = reference.T @ x
                g = np.linalg.solve(jacobian, reference.T)
                weight *= np.linalg.det(jacobian)
                element += weight * lame * np.einsum("ia,jb->aibj", g, g)
                element += weight * mu * (np.einsum("ja,ib->aibj", g, g) + np.einsum("ka,kb,ij->aibj", g, g, np.eye(d)))
            rows = (d * nodes[:, None] + np.arange(d)).ravel()
            total[np.ix_(rows, rows)] += element.reshape(len(rows), -1)
    return total


MESHES = {
    "quad": ss.Mesh.rectangle([0, 0], [2, 1], [6, 3]),
    "triangle": ss.Mesh.rectangle([0, 0], [2, 1], [6, 3]).simplices(),
    "hexahedron": ss.Mesh.block([0, 0, 0], [2, 1, 1], [4, 2, 2]),
    "tetra": ss.Mesh.block([0, 0, 0], [2, 1, 1], [4, 2, 2]).simplices(),
}


def skewed(mesh):
    """The same with nodes moved, so that no cell is like another."""
    x = mesh.points
    moved = x + 0.04 * np.sin(3 * x[:, ::-1] + np.arange(mesh.dimension))
    moved[:, -1] = np.where(x[:, -1] == 0, 0.02 * (x[:, 0] - 1) ** 2, moved[:, -1])
    return ss.Mesh(moved, mesh.cells, facets=dict(mesh.facets))


@pytest.mark.parametrize("kind", MESHES)
def test_stiffness_is_that_of_our_own_assembly(kind):
    from scipy import sparse

    mesh = skewed(MESHES[kind])
    body = ss.Body(mesh, ss.Material(3.0, 0.3), supports={"left": 0.0})
    fixed = np.unique(dict(mesh.facets)["left"])
    free = np.setdiff1d(np.arange(mesh.num_nodes), fixed)
    rows = (mesh.dimension * free[:, None] + np.arange(mesh.dimension)).ravel()
    expected = stiffness(mesh, 3.0, 0.3)[np.ix_(rows, rows)]
    found = sparse.csc_matrix(body.stiffness).toarray()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * abs(expected).max())


@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("form", ["condensed", "full"])
def test_solutions_fulfil_every_condition(kind, form):
    mesh = skewed(MESHES[kind])
    d = mesh.dimension
    body = ss.Body(mesh, ss.Material(3.0, 0.3), supports={"top": [0.01] + [0.0] * (d - 2) + [lambda x: -0.03 - 0.01 * x[0]]})
    friction = 0.3 if d == 2 else (0.3, 0.2)
    ground = ss.Foundation.plane([0.0] * d, [0.0] * (d - 1) + [1.0])
    side = body.traction("right", [0.01] + [0.0] * (d - 1)) + 2.0 * body.body_force([0.0] * (d - 1) + [-0.001])
    problem = ss.ContactProblem(body, "bottom", ground, friction, load=side, form=form)
    solution = problem.solve(1.0)
    open_, stick, slip = solution.counts
    assert open_ + stick + slip == problem.num_contacts and slip > 0 and stick + open_ > 0
    # Signorini and Coulomb at each node.
    pressure, penetration = solution.pressures, solution.penetrations
    scale, length = pressure.max(), 0.03
    assert pressure.min() >= -1e-12 * scale and penetration.max() <= 1e-12 * length
    assert abs(pressure * penetration).max() <= 1e-12 * scale * length
    f = np.array([0.3]) if d == 2 else np.array(friction)
    bound = np.linalg.norm(solution.tractions / f, axis=1) - pressure
    assert bound.max() <= 1e-12 * scale
    # λt ∈ F² u_t λν / ‖F u_t‖ where the node slips, u_t = 0 where it does not reach the bound.
    size = np.linalg.norm(f * solution.slips, axis=1)
    law = solution.tractions * size[:, None] - f**2 * solution.slips * pressure[:, None]
    assert abs(law).max() <= 1e-11 * scale * length
    # Equilibrium of all nodes with our own stiffness matrix, loads and reactions.
    u = solution.displacements
    force = (stiffness(mesh, 3.0, 0.3) @ u.ravel()).reshape(-1, d)
    force -= solution.reactions
    contact = -pressure[:, None] * problem.normals - sum(solution.tractions[:, [k]] * t for k, t in enumerate(problem.tangents))
    np.add.at(force, problem.nodes, -contact)
    free = np.ones(mesh.num_nodes, dtype=bool)
    free[np.unique(dict(mesh.facets)["top"])] = False
    assert abs(force[free].ravel() - side.forces).max() <= 1e-12 * scale
    assert abs(force[~free]).max() <= 1e-12 * scale
    top = np.unique(dict(mesh.facets)["top"])
    np.testing.assert_allclose(u[top, -1], -0.03 - 0.01 * mesh.points[top, 0], rtol=1e-14)
    # Energies: that of our matrix, and the balance.
    energy = solution.energy
    own = 0.5 * u.ravel() @ stiffness(mesh, 3.0, 0.3) @ u.ravel()
    assert energy["stored"] == pytest.approx(own, rel=1e-12)
    balance = 2 * energy["stored"] - energy["load"] + energy["normal"] + energy["friction"]
    assert abs(balance) <= 1e-12 * energy["stored"]
    assert max(solution.residuals.values()) <= 1e-11


def test_a_strip_pressed_evenly_has_the_stress_of_the_textbook():
    mesh = MESHES["triangle"]
    body = ss.Body(mesh, ss.Material(3.0, 0.3), supports={"top": [lambda x: 0.01 * 0.3 / 0.7 * x[0], -0.01]})
    solution = ss.ContactProblem(body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), None).solve()
    vertical = -0.01 * 3.0 / (1 - 0.3**2)
    expected = [0.0, vertical, 0.3 * vertical, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(solution.stresses, np.tile(expected, (mesh.num_cells, 1)), rtol=0, atol=1e-15)
    np.testing.assert_allclose(solution.pressures / solution.problem.areas, -vertical, rtol=1e-12)


def test_without_friction_the_problem_is_a_linear_complementarity_problem():
    from scipy import sparse

    body = ss.Body(skewed(MESHES["quad"]), ss.Material(3.0, 0.3), supports={"left": 0.0})
    ground = ss.Foundation.gap(lambda x: 0.001 + 0.002 * x[0])
    load = body.traction("top", [0.0, -0.01])
    problem = ss.ContactProblem(body, "bottom", ground, None, load=load)
    solution = problem.solve()
    # u_ν is linear in the nodal forces: columns by unit loads on our own factorisation.
    a = sparse.csc_matrix(body.stiffness).toarray()
    free = np.setdiff1d(np.arange(body.mesh.num_nodes), np.unique(dict(body.mesh.facets)["left"]))
    normal = np.zeros((problem.num_contacts, len(a)))
    for i, node in enumerate(problem.nodes):
        k = 2 * np.flatnonzero(free == node)[0]
        normal[i, k : k + 2] = problem.normals[i]
    compliance = normal @ np.linalg.solve(a, normal.T)
    q = problem.gaps - normal @ np.linalg.solve(a, load.forces)
    result = ss.solve_lcp(compliance, q)
    assert result.solved
    np.testing.assert_allclose(solution.pressures, result.x, atol=1e-11 * result.x.max())
    assert set(solution.states) <= {"open", "slip+", "slip-"} and 0 < solution.counts[0] < problem.num_contacts


def sheared(**options):
    body = ss.Body(ss.Mesh.rectangle([0, 0], [2, 1], [8, 4]), ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]})
    return ss.ContactProblem(body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), 0.4, **(options or {"rate": body.motion("top", [0.05, None])}))


def test_histories_balance_and_can_be_continued():
    problem = sheared()
    levels = [0.5, 1.0, 0.5, 0.0, -1.0, 1.0]
    told = []
    steps = ss.evolve(problem, problem.solve(0.0), levels, callback=told.append)
    assert told == steps and [s.level for s in steps] == levels
    for step in steps:
        assert step.arrival == "followed" and step.folds == [] and step.dissipated > 0
        assert step.work == pytest.approx(step.stored + step.dissipated, rel=1e-10)
    # Levels between two reversals change nothing; the problem keeps no history.
    once = ss.evolve(problem, problem.solve(0.0), [1.0, -1.0, 1.0])
    for a, b in ((1, 0), (4, 1), (5, 2)):
        np.testing.assert_allclose(steps[a].solution.pressures, once[b].solution.pressures, rtol=1e-10)
    half = ss.evolve(problem, problem.solve(0.0), levels[:3])
    rest = ss.evolve(problem, half[-1], levels[3:])
    np.testing.assert_array_equal(rest[-1].solution.x, steps[-1].solution.x)
    assert len(ss.evolve(problem, problem.solve(0.0), levels, callback=lambda s: s.level == 1.0)) == 2


@pytest.mark.parametrize("solid", [False, True])
def test_large_bodies_are_solved_in_their_displacements(solid):
    cells, upper = ([8, 8, 4], [2, 2, 1]) if solid else ([32, 16], [2, 1])
    make = ss.Mesh.block if solid else ss.Mesh.rectangle
    down, across = ([0.0, 0.0, -0.02], [0.05, 0.01, None]) if solid else ([0.0, -0.02], [0.05, None])
    body = ss.Body(make([0.0] * len(upper), upper, cells), ss.Material(1.0, 0.3), supports={"top": down})
    ground = ss.Foundation.plane([0.0] * len(upper), np.eye(len(upper))[-1])

    def problem(form):
        return ss.ContactProblem(body, "bottom", ground, 0.4, rate=body.motion("top", across), form=form)

    condensed, reduced = problem("condensed"), problem("reduced")
    assert reduced.num_vars == problem("full").num_vars
    n = body.num_free
    for parameter in (0.0, 0.3, 0.6):
        a, b = condensed.solve(parameter), reduced.solve(parameter)
        size = np.abs(a.x[:-1]).max()
        np.testing.assert_allclose(b.x[n:-1], a.x[:-1], atol=1e-8 * size, rtol=0)
        np.testing.assert_allclose(b.displacements, a.displacements, atol=1e-8 * np.abs(a.displacements).max(), rtol=0)
        np.testing.assert_allclose(b.reactions, a.reactions, atol=1e-8 * np.abs(a.reactions).max(), rtol=0)
        assert b.strategy == "Newton" and max(b.residuals.values()) <= 1e-10
        assert abs(b.energy["stored"] - a.energy["stored"]) <= 1e-8 * a.energy["stored"]
        # The point is one of the full form, whose residuals are measured there.
        assert max(problem("full").at(b.x).residuals.values()) <= 1e-9
        assert reduced.at(b.x).states == b.states and reduced.solve(parameter, b).states == b.states

    levels = [0.3, 0.6, 0.2]
    told = []
    a = ss.evolve(condensed, condensed.solve(0.0), levels)
    b = ss.evolve(reduced, reduced.solve(0.0), levels, callback=told.append)
    assert [s.level for s in b] == levels and [s.level for s in told] == levels
    for s, t in zip(a, b):
        size = np.abs(s.solution.x[:-1]).max()
        np.testing.assert_allclose(t.solution.x[n:-1], s.solution.x[:-1], atol=1e-8 * size, rtol=0)
        assert t.arrival == "solved" and t.folds == [] and np.isnan(t.work)
        assert abs(t.stored - s.stored) <= 1e-8 * a[1].solution.energy["stored"]
        assert t.dissipated >= 0.0
    # A history continued from a level is the rest of an uninterrupted one.
    rest = ss.evolve(reduced, b[1], levels[2:])
    np.testing.assert_allclose(rest[0].solution.x, b[2].solution.x, atol=1e-8 * np.abs(b[2].solution.x).max(), rtol=0)


def test_the_size_of_a_body_chooses_its_route():
    def problem(n):
        body = ss.Body(ss.Mesh.block([0, 0, 0], [1, 1, 1], [n, n, n]), ss.Material(1.0, 0.3), supports={"top": 0.0})
        ground = ss.Foundation.plane([0, 0, 0], [0, 0, 1])
        return body.num_free, ss.ContactProblem(body, "bottom", ground, 0.4, form="auto")

    small, large = problem(4), problem(13)
    assert small[0] < 6000 < large[0]
    assert small[1].num_vars == 3 * 25 + 1 and large[1].num_vars == large[0] + 3 * 14**2 + 1


def test_what_is_worn_off_is_remembered():
    body = sheared().body
    friction = ss.Friction.exponential(0.4, 0.2, 0.005)
    problem = ss.ContactProblem(body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), friction, rate=body.motion("top", [0.05, None]))
    for forgets in (False, True):
        start = problem.solve(0.0)
        steps = ss.evolve(problem, start, [0.2, 0.5, -0.5], slip_increments=forgets)
        total = abs(start.slips[:, 0])
        for step in steps:
            own = abs(step.solution.slips[:, 0])
            total = own if forgets else total + own
            if not forgets:
                np.testing.assert_allclose(step.history[:, 0], total, rtol=1e-12)
            moved = np.array([s.startswith("slip") for s in step.solution.states])
            assert moved.any()
            bound = np.array([friction(s) for s in total]) * step.solution.pressures
            np.testing.assert_allclose(abs(step.solution.tractions[moved, 0]), bound[moved], rtol=1e-9)


def test_paths_of_loads_are_sums_of_cases():
    body = sheared().body
    push, turn = body.motion("top", [0.05, None]), body.traction("right", [0.0, 0.002])
    straight = sheared(rate=push)
    curved = sheared(load=-1.0 * push, rate=2 * push - push, paths=[(push, lambda a: np.sin(a) + 1 - a), (turn, lambda a: a**2)])
    for alpha in (0.0, 0.3, 0.9):
        x = curved.solve(alpha)
        if alpha == 0.0:
            np.testing.assert_allclose(x.pressures, straight.solve(0.0).pressures, rtol=1e-12)
        same = sheared(load=np.sin(alpha) * push + alpha**2 * turn).solve(0.0)
        np.testing.assert_allclose(x.displacements, same.displacements, rtol=0, atol=1e-13)
    branch = ss.follow(curved, curved.solve(0.0), parameter_range=(0.0, 0.9))
    np.testing.assert_allclose(branch.points[-1][:-1], curved.solve(0.9).x[:-1], rtol=0, atol=1e-10)
    assert branch.transitions and branch.termination == "bound of the parameter"


def test_lists_of_solutions_and_diagrams_take_contact_problems():
    problem = sheared()
    found = ss.all_solutions(problem, 0.7)
    assert found.complete and len(found) == 1
    np.testing.assert_allclose(found.points[0], problem.solve(0.7).x, rtol=0, atol=1e-12)
    diagram = ss.diagram(problem, [problem.solve(0.0)], parameter_range=(0.0, 1.0))
    np.testing.assert_allclose(diagram.solutions_at(0.7), found.points, rtol=0, atol=1e-12)
    branch = ss.follow(problem, problem.solve(0.0), parameter_range=(0.0, 1.0))
    # Nodes that change are among the sites; pieces are named as states.
    for t in branch.transitions:
        changed = [k for k, (a, b) in enumerate(zip(t.before, t.after)) if a != b]
        assert changed and set(changed) <= set(t.sites)
        assert problem.at(t.x).states.count("open") in (0, 1)


def test_a_transition_is_followed_in_a_second_load():
    problem = sheared()
    branch = ss.follow(problem, problem.solve(0.0), parameter_range=(0.0, 1.0))
    first = branch.transitions[0]
    pressed = problem.body.motion("top", [None, -0.01])
    family = problem.with_second_parameter(pressed)
    start = np.append(first.x, 0.0)
    site = first.sites[0]
    test = int(np.argmin(abs(first.test_functions[3 * site + 1 : 3 * site + 3]))) + 1
    curve = ss.transition_set(family, start, site, test, parameter_range=(0.0, 0.5))
    assert curve.branch.parameter[-1] == 0.5 and set(curve.folds) <= {False, None}
    # The same transition under the larger load, found on its own curve.
    alpha, beta = curve.branch.points[-1][-2:]
    other = sheared(load=beta * pressed, rate=problem.body.motion("top", [0.05, None]))
    points = ss.follow(other, other.solve(0.0), parameter_range=(0.0, 1.0)).transitions
    assert min(abs(t.parameter - alpha) for t in points if site in t.sites) < 1e-9
    with pytest.raises(TypeError, match="two parameters"):
        family.solve(0.0)


def test_laws():
    body = sheared().body
    ground = ss.Foundation.plane([0, 0], [0, 1])
    push = body.motion("top", [0.05, None])
    p = sheared().num_contacts

    def at(friction, alpha=0.6):
        return ss.ContactProblem(body, "bottom", ground, friction, load=push).solve(alpha).x[:-1]

    reference = at(0.24)
    same = [
        ss.Friction(0.24),
        np.full(p, 0.24),
        ss.Friction(0.0, 0.4),
        ss.Friction(np.zeros(p), 0.4),
        ss.Friction(0.0, np.full(p, 0.4)),
        ss.Friction(0.4).scaled(),
        ss.Friction.table([0.0], [0.4]).scaled(),
        ss.Friction.function(lambda slip, a: 0.4 * a),
    ]
    for friction in same:
        np.testing.assert_allclose(at(friction), reference, rtol=0, atol=1e-12)
    table = ss.Friction.table([0.0, 0.01, 0.03], [0.5, 0.3, 0.2])
    assert [table(s) for s in (0.0, 0.01, 0.03, 1.0)] == pytest.approx([0.5, 0.3, 0.2, 0.2])
    assert ss.Friction.exponential(0.5, 0.2, 0.01)(0.01) == pytest.approx(0.2 + 0.3 / np.e)
    assert ss.Friction.function(weakening)(0.005, 2.0) == pytest.approx(0.2 + 0.6 / np.e)


def test_materials():
    mesh = MESHES["quad"].with_cells("hard", lambda x: x[:, 0] > 1)
    assert len(dict(mesh.cell_groups)["hard"]) == 9
    soft = ss.Material(1.0, 0.3)
    lame = ss.Material.lame(0.3 / (1.3 * 0.4), 1 / 2.6)
    np.testing.assert_allclose(lame.components, soft.components, rtol=1e-14)
    np.testing.assert_array_equal(ss.Material.tensor(soft.components).components, soft.components)

    def of(**options):
        return ss.Body(mesh, soft, supports={"left": 0.0}, **options).stiffness[0]

    np.testing.assert_array_equal(of(materials={"hard": soft}), of())
    assert of(materials={"hard": ss.Material(10.0, 0.3)}).max() > 5 * of().max()
    # Plane stress of E, ν is plane strain of E (1 + 2ν)/(1 + ν)², ν/(1 + ν).
    other = ss.Material(1.0 * 1.6 / 1.3**2, 0.3 / 1.3)
    np.testing.assert_allclose(ss.Body(mesh, other, supports={"left": 0.0}).stiffness[0], of(plane="stress"), rtol=0, atol=1e-13)


class Failed(Exception):
    pass


def fails(*_):
    raise Failed


def test_exceptions_of_functions_come_out_unchanged():
    body = sheared().body
    mesh, soft = body.mesh, ss.Material(1.0, 0.3)
    for work in [
        lambda: ss.Body(mesh, soft, supports={"top": fails}),
        lambda: body.traction("top", fails),
        lambda: body.body_force(fails),
        lambda: body.motion("top", [fails, None]),
        lambda: ss.ContactProblem(body, "bottom", ss.Foundation.gap(fails), 0.3),
        lambda: ss.ContactProblem(body, "bottom", ss.Foundation.gap(0.0, normal=fails), 0.3),
        lambda: ss.ContactProblem(body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), ss.Friction.function(fails)),
        lambda: mesh.with_boundary("x", fails),
        lambda: mesh.with_cells("x", fails),
        lambda: ss.evolve(sheared(), sheared().solve(), [0.5], callback=fails),
        lambda: ss.follow(sheared(), sheared().solve(), (0.0, 1.0), callback=fails),
        lambda: ss.evolve(LARGE, LARGE.solve(), [0.5], callback=fails),
    ]:
        with pytest.raises(Failed):
            work()


BODY = sheared().body
GROUND = ss.Foundation.plane([0, 0], [0, 1])
LARGE = ss.ContactProblem(BODY, "bottom", GROUND, 0.4, rate=BODY.motion("top", [0.05, None]), form="reduced")
TRIANGLE = [[0, 0], [1, 0], [0, 1]]


@pytest.mark.parametrize(
    ("work", "says"),
    [
        (lambda: ss.Mesh([[0, 0, 0, 0]], {}), "4 coordinates"),
        (lambda: ss.Mesh(TRIANGLE, {"triangle7": [[0, 1, 2, 0, 1, 2, 0]]}), "triangle7"),
        (lambda: ss.Mesh(TRIANGLE, {"triangle": [[0, 1, 3]]}), "node 3"),
        (lambda: ss.Mesh(TRIANGLE, {"triangle": [[0, 1, -1]]}), "negative"),
        (lambda: ss.Mesh(TRIANGLE, {"triangle": [[0, 1, 2]]}, cell_groups={"a": [1]}), "cell 1"),
        (lambda: ss.Mesh(TRIANGLE, {"triangle": [[0, 1, 2]]}, cell_groups={"a": [True, False]}), "length 2, expected 1"),
        (lambda: ss.Mesh(TRIANGLE, {"triangle": [[0, 1, 2]]}, facets={"a": [[0]]}), "facet 0"),
        (lambda: ss.Mesh([[0, 0], [1, 0], [2, 0]], {"triangle": [[0, 1, 2]]}), "Jacobian"),
        (lambda: ss.Material(1.0, 0.5), "Poisson"),
        (lambda: ss.follow(LARGE, LARGE.solve(), (0.0, 1.0)), "form=\"condensed\""),
        (lambda: ss.all_solutions(LARGE), "form=\"condensed\""),
        (lambda: LARGE.solve(states=["stick"]), "not from states"),
        (lambda: LARGE.solve(tolerance=-1.0), "tolerance"),
        (lambda: LARGE.solve(max_memory=1), "bytes would be needed"),
        (lambda: LARGE.solve(start=[0.0]), "length 1"),
        (lambda: LARGE.at([0.0]), "length 1"),
        (lambda: LARGE.solve(1.0, max_time=0.0), "limit on time"),
        (lambda: ss.evolve(LARGE, LARGE.solve(), [0.5], callback=lambda s: LARGE.solve()), "one thing at a time"),
        (lambda: ss.Body(BODY.mesh, ss.Material(1, 0.3), supports={"roof": 0.0}), "roof"),
        (lambda: ss.Body(BODY.mesh, ss.Material(1, 0.3), supports={"top": [0.0]}), "2 components"),
        (lambda: ss.Body(BODY.mesh, ss.Material(1, 0.3), supports={}), "floats"),
        (lambda: ss.Body(BODY.mesh, ss.Material(1, 0.3), supports={"top": "no"}), "number or a function"),
        (lambda: ss.Body(BODY.mesh, ss.Material(1, 0.3), supports={"top": 0.0}, plane="stretch"), "stretch"),
        (lambda: BODY.traction("top", [1.0]), "length 1, expected 2"),
        (lambda: BODY.motion("bottom", 1.0), "prescribed"),
        (lambda: ss.ContactProblem(BODY, "roof", GROUND, 0.3), "roof"),
        (lambda: ss.ContactProblem(BODY, "bottom", GROUND, -0.3), "negative"),
        (lambda: ss.ContactProblem(BODY, "bottom", GROUND, [0.3, 0.3]), "2"),
        (lambda: ss.ContactProblem(BODY, "bottom", GROUND, 0.3, form="dense"), "dense"),
        (lambda: ss.ContactProblem(BODY, "bottom", ss.Foundation.plane([0, 0], [0, -1]), 0.3), "points into the body"),
        (lambda: ss.ContactProblem(BODY, "bottom", ss.Foundation.plane([0, 0, 0], [0, 0, 1]), 0.3), "length 3, expected 2"),
        (lambda: ss.ContactProblem(BODY, "bottom", GROUND, ss.Friction.function(lambda s, a: abs(a))), "kinks: 1"),
        (lambda: ss.ContactProblem(BODY, "bottom", GROUND, ss.Friction([0.1], 0.1).scaled()), "slip alone"),
        (lambda: sheared().solve(0.0, states=["stick"]), "9"),
        (lambda: sheared().solve(0.0, states=["glue"] * 9), "glue"),
        (lambda: sheared().solve(0.0, [0.0]), "length"),
        (lambda: sheared().solve(0.0, max_ways=3), "max_ways"),
        (lambda: sheared().solve(float("nan")), "finite"),
        (lambda: sheared().at([0.0]), "length"),
        (lambda: ss.evolve(sheared(), sheared().solve(), [float("inf")]), "finite"),
        (lambda: ss.evolve(sheared(), [0.0], [1.0]), "length"),
        (lambda: ss.follow(sheared(), [0.0, 0.0]), "19"),
        (lambda: ss.transition_set(sheared(), sheared().solve().x, 0), "expected|must give|values"),
        (lambda: ss.transition_set(lambda x: [x[0] - x[1]], [0.0, 0.0, 0.0], 5), "5|piece"),
    ],
)
def test_what_does_not_serve_is_refused(work, says):
    with pytest.raises((ValueError, TypeError), match=says):
        work()


def half(whole, d, friction, n=3):
    """A block pressed on a foundation with a parabolic gap, or its part with x ≥ 0 (and y ≥ 0)."""
    low, across = (-1.0, 2 * n) if whole else (0.0, n)
    if d == 2:
        mesh = ss.Mesh.rectangle([low, 0], [1, 1], [across, n])
    else:
        mesh = ss.Mesh.block([low, low, 0], [1, 1, 1], [across, across, n])
    supports = {"top": [0.0] * (d - 1) + [-0.01]}
    if not whole:
        sides = ["left", "front"][: d - 1]
        supports = {side: [0.0 if k == e else None for e in range(d)] for k, side in enumerate(sides)} | supports
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports=supports)
    ground = ss.Foundation.gap(lambda x: 0.004 * (x[:-1] @ x[:-1]))
    return ss.ContactProblem(body, "bottom", ground, friction)


@pytest.mark.parametrize("d, friction", [(2, 0.3), (2, None), (3, (0.3, 0.05)), (3, None)])
def test_parts_with_planes_of_symmetry_are_the_whole(d, friction):
    parts = [half(whole, d, friction) for whole in (False, True)]
    (own, x), (whole, y) = ((p, p.solve()) for p in parts)
    assert own.held.shape == (own.num_contacts, d - 1) and not whole.held.any()
    assert (own.held.any(axis=1) == (own.points[:, : d - 1] == 0).any(axis=1)).all()
    share = 0.5 ** (own.points[:, : d - 1] == 0).sum(axis=1)
    index = [np.argmin(np.linalg.norm(whole.points - p, axis=1)) for p in own.points]
    assert np.abs(x.pressures - share * y.pressures[index]).max() < 1e-10 * y.pressures.max()


def test_lists_of_half_models_say_so():
    found = ss.all_solutions(half(False, 2, 0.3))
    assert found.complete and len(found) == 1
    assert "symmetric solutions only" in found.completeness and "symmetric" in repr(found)
    assert ss.all_solutions(half(True, 2, 0.3)).completeness == "complete"


def two_bodies(n, m, left):
    """Two unit squares, one above the other, with n and m edges at their interface, on rollers at the left: uniform stress."""
    parts = [ss.Mesh.rectangle([0, 1], [1, 2], [n, 2]), ss.Mesh.rectangle([0, 0], [1, 1], [m, 2])]
    first = len(parts[0].points)
    points = np.vstack([p.points for p in parts])
    cells = [("quad", np.vstack([parts[0].cells[0][1], parts[1].cells[0][1] + first]))]
    mesh = ss.Mesh(points, cells)
    mesh = mesh.with_boundary("upper", lambda x, nu: (nu[:, 1] < -0.5) & (x[:, 1] > 0.5))
    mesh = mesh.with_boundary("lower", lambda x, nu: (nu[:, 1] > 0.5) & (x[:, 1] < 1.5))
    mesh = mesh.with_boundary("top", lambda x, nu: x[:, 1] > 1.99).with_boundary("base", lambda x, nu: x[:, 1] < 0.01)
    mesh = mesh.with_boundary("left", lambda x, nu: nu[:, 0] < -0.5)
    return ss.Body(mesh, ss.Material(1.0, 0.3), supports={"top": [None, -0.02], "base": [None, 0.0], "left": left})


@pytest.mark.parametrize("roles", [("upper", "lower"), ("lower", "upper")])
def test_uniform_stress_passes_between_bodies(roles):
    body = two_bodies(3, 4, [0.0, None])
    for other in (roles[1], ss.Mortar(roles[1]), ss.Mortar(roles[1], gap=lambda x: 0.0 * x[0], reach=0.1)):
        problem = ss.ContactProblem(body, roles[0], other, 0.3)
        solution = problem.solve()
        exact = 0.01 / (1 - 0.3**2)
        assert np.abs(solution.pressures / problem.areas - exact).max() < 1e-12 * exact * 10
    with pytest.raises(ss.SemismoothError, match="opposite"):
        ss.ContactProblem(body, "upper", "base", 0.3)
    with pytest.raises(TypeError, match="Mortar"):
        ss.ContactProblem(body, "upper", 3, 0.3)


def test_nearly_incompressible_bodies_are_told():
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [16, 8])
    supports = {"top": [0.0, -0.01], "bottom": [None, 0.0]}
    body = ss.Body(mesh, ss.Material(1.0, 0.4999), supports=supports)
    assert len(body.notes) == 1 and "128 quadrilaterals have the mean" in body.notes[0]
    assert ss.Body(mesh, ss.Material(1.0, 0.3), supports=supports).notes == []
    with pytest.warns(UserWarning, match="256 triangles of first order lock"):
        ss.Body(mesh.simplices(), ss.Material(1.0, 0.4999), supports=supports)
    with pytest.warns(UserWarning, match="quadrilaterals of first order lock"):
        ss.Body(mesh, ss.Material(1.0, 0.4999), supports=supports, dilatation="pointwise")
    # Quadrilaterals of nine nodes, extrapolated, as in tests/fem/dilatation.rs.
    contact = ss.ContactProblem(ss.Body(mesh, ss.Material(1.0, 0.4999), supports={"top": [0.0, -0.01]}), "bottom", GROUND, None)
    assert abs(contact.solve().pressures.sum() / 0.034985 - 1) < 0.02


def test_cells_of_second_order_do_not_lock():
    boxes = ss.Mesh.rectangle([0, 0], [2, 1], [16, 8])
    meshes = {"triangle6": boxes.simplices().second_order(), "quad9": boxes.second_order(), "quad8": boxes.serendipity()}
    for kind, mesh in meshes.items():
        assert mesh.cells[0][0] == kind
        body = ss.Body(mesh, ss.Material(1.0, 0.4999), supports={"top": [0.0, -0.01]})
        assert body.notes == []
        problem = ss.ContactProblem(body, "bottom", GROUND, None)
        assert problem.num_contacts == 17
        assert abs(problem.solve().pressures.sum() / 0.034985 - 1) < 0.03


def derivative_problem(form="condensed", gap=0.0, friction=0.3, young=1.0, shift=0.0, field=None):
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [8, 4])
    if field is not None:
        mesh = ss.Mesh(mesh.points + shift * field, mesh.cells, facets=dict(mesh.facets))
    body = ss.Body(mesh, ss.Material(young, 0.3), supports={"left": [0.0, 0.0]})
    foundation = ss.Foundation.plane([0, -gap], [0, 1])
    load, rate = body.traction("top", [0.0, -0.02]), body.traction("top", [0.02, 0.0])
    return ss.ContactProblem(body, "bottom", foundation, friction, load=load, rate=rate, form=form)


@pytest.mark.parametrize("form", ["condensed", "full", "reduced"])
def test_solutions_have_derivatives_in_all_data(form):
    problem = derivative_problem(form)
    solution = problem.solve(0.5)
    p = len(solution.pressures)
    ones = np.ones((p, 1))
    found = solution.sensitivity(parameter=True, gaps=ones, friction=ones, young=True)
    assert found.differentiable is True and len(found) == 4
    assert found.slices == {"parameter": slice(0, 1, 1), "gaps": slice(1, 2, 1), "friction": slice(2, 3, 1), "young": slice(3, 4, 1)}
    h = 1e-6
    for k, change in enumerate([{}, {"gap": h}, {"friction": h}, {"young": h}]):
        moved = []
        for s in (1, -1):
            data = {"gap": 0.0, "friction": 0.3, "young": 1.0}
            for name, size in change.items():
                data[name] += s * size
            moved.append(derivative_problem("condensed", **data).solve(0.5 + s * h * (k == 0)))
        u, pressures, tractions = found.jvp(np.eye(4)[k])
        for rate, name in [(u, "displacements"), (pressures, "pressures"), (tractions, "tractions")]:
            difference = (getattr(moved[0], name) - getattr(moved[1], name)) / (2 * h)
            np.testing.assert_allclose(rate, difference, atol=2e-6 * np.abs(difference).max() + 1e-9)
    rng = np.random.default_rng(0)
    w = [rng.normal(size=part.shape) for part in found.jvp(np.zeros(4))]
    dp = rng.normal(size=4)
    forward = sum((a * b).sum() for a, b in zip(w, found.jvp(dp)))
    assert found.vjp(*w) @ dp == pytest.approx(forward, rel=1e-7)
    by_columns = found.derivative()
    np.testing.assert_allclose((by_columns @ dp)[-2 * p : -p], found.jvp(dp)[1], atol=1e-9)
    if form == "reduced":
        with pytest.raises(ss.SemismoothError, match="reduced form"):
            found.valid_until([1.0, 0, 0, 0])
    else:
        assert found.valid_until([1.0, 0, 0, 0]) == pytest.approx(solution.valid_until(), rel=1e-6)
        with pytest.raises(ss.SemismoothError, match="first order"):
            found.valid_until([0, 0, 0, 1.0])


@pytest.mark.parametrize("form", ["condensed", "full"])
def test_changes_of_the_material_have_a_range_where_their_problems_are_given(form):
    """Softer bodies keep the states of their nodes up to there, and not beyond."""
    softer = lambda s: derivative_problem(form, gap=0.05, young=1.0 - s)
    solution = softer(0.0).solve(0.5)
    found = solution.sensitivity(young=True)
    until = found.valid_until([-1.0], horizon=0.8, problem=softer)
    assert 0.0 < until < 0.8
    before, after = (softer(until * t).solve(0.5, start=solution).states for t in (1 - 1e-6, 1 + 1e-6))
    assert list(before) == list(solution.states) and list(after) != list(before)
    with pytest.raises(ZeroDivisionError):
        found.valid_until([-1.0], problem=lambda s: 1 / 0)
    with pytest.raises(TypeError, match="ContactProblem"):
        found.valid_until([-1.0], problem=lambda s: s)


def test_solutions_have_derivatives_in_the_shape_of_their_body():
    problem = derivative_problem()
    points = problem.body.mesh.points
    below = 1 - points[:, 1]
    field = np.stack([0.1 * below * points[:, 1], 0.02 * points[:, 0] * below], axis=1)
    solution = problem.solve(0.5)
    found = solution.sensitivity(loads=[problem.body.traction("top", [0.0, -1.0])], positions=[field])
    assert list(found.slices) == ["loads", "positions"]
    rates = found.jvp([0.0, 1.0])
    h = 1e-6
    # The top is not stretched, so that the forces on its nodes stay as they are.
    moved = [derivative_problem(field=field, shift=s * h).solve(0.5) for s in (1, -1)]
    for rate, name in zip(rates, ["displacements", "pressures", "tractions"]):
        difference = (getattr(moved[0], name) - getattr(moved[1], name)) / (2 * h)
        np.testing.assert_allclose(rate, difference, atol=1e-5 * np.abs(difference).max())
    with pytest.raises(ValueError, match="field 0 has shape"):
        solution.sensitivity(positions=[field[:3]])


def test_derivatives_of_contact_refuse_what_they_cannot_use():
    solution = derivative_problem().solve(0.5)
    p = len(solution.pressures)
    with pytest.raises(ValueError, match="name the data"):
        solution.sensitivity()
    with pytest.raises(ss.SemismoothError, match="gaps"):
        solution.sensitivity(gaps=np.ones((p + 1, 1)))
    with pytest.raises(ss.SemismoothError, match="nowhere"):
        solution.sensitivity(young="nowhere")
    with pytest.raises(ValueError, match="load 0 has 3 forces"):
        solution.sensitivity(loads=[np.zeros(3)])
    bound = derivative_problem(friction=ss.GivenBound(0.01)).solve(0.0)
    with pytest.raises(ValueError, match="Coulomb"):
        bound.sensitivity(friction=True)
    found = solution.sensitivity(gaps=True)
    with pytest.raises(ValueError, match="pressures must have the shape"):
        found.vjp(pressures=np.zeros(p + 1))
    with pytest.raises(ss.SemismoothError, match="length"):
        found.jvp([1.0])


def test_springs_foundations_and_supports_at_nodes_by_statics():
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [4, 1])
    ends = mesh.with_nodes("left end", lambda x: x[:, 0] == 0).with_nodes("right end", lambda x: x[:, 0] == 2)
    material = ss.Material(4.0, 0.0)
    # Stiffness E A / L = 2 in series with two nodes of 1 each.
    body = ss.Body(ends, material, supports={"bottom": [None, 0.0]}, springs={"left end": [1.0, 0.0]})
    problem = ss.ContactProblem(body, "top", ss.Foundation.plane([0, 2], [0, -1]), None, load=body.traction("right", [1.0, 0.0]))
    u = problem.solve().displacements
    np.testing.assert_allclose(u[:, 0], 1 / 2 + mesh.points[:, 0] / 4, atol=1e-14)
    # A rigid block on a bed, pulled sideways at two corners.
    bed = ss.Body(ends, ss.Material(1e7, 0.3), supports={}, foundations={"bottom": [3.0, 0.5]})
    pull = bed.nodal_force("right end", [0.01, 0.0]) + bed.body_force([0.0, -1.0])
    block = ss.ContactProblem(bed, "top", ss.Foundation.plane([0, 2], [0, -1]), None, load=pull).solve()
    assert block.displacements[:, 1].mean() == pytest.approx(-1 / 3, abs=1e-5)
    corner = ends.with_nodes("corner", lambda x: (x[:, 0] == 0) & (x[:, 1] == 0)).with_nodes(
        "other", lambda x: (x[:, 0] == 2) & (x[:, 1] == 0)
    )
    assert ss.Body(corner, material, supports={"corner": 0.0, "other": [None, 0.0]}).num_free == 17
    again = pickle.loads(pickle.dumps(body))
    np.testing.assert_array_equal(again.stiffness[0], body.stiffness[0])
    for options, words in [
        ({"springs": {"nowhere": 1.0}}, 'no group "nowhere" of nodes'),
        ({"springs": {("left end", "corner"): 1.0}}, "2 and 1 nodes"),
        ({"springs": {"corner": -1.0}}, "must be finite and not negative"),
        ({"springs": {"corner": [1.0]}}, "2 components"),
        ({"foundations": {"nowhere": 1.0}}, 'no group "nowhere" of facets'),
        ({"foundations": {"bottom": [1.0]}}, "a pair"),
    ]:
        with pytest.raises((ss.SemismoothError, ValueError, TypeError), match=words):
            ss.Body(corner, material, supports={"left": 0.0}, **options)


def test_histories_have_derivatives_in_all_levels():
    def states(gap=0.0, friction=0.3):
        problem = derivative_problem(gap=gap, friction=friction)
        start = problem.solve(0.2)
        return start, ss.evolve(problem, start, [0.9, -0.4, 0.3])

    start, steps = states()
    ones = np.ones((len(start.pressures), 1))
    found = ss.history_sensitivity(start, steps, gaps=ones, friction=ones)
    assert found.differentiable is True and len(found) == 2 and list(found.slices) == ["gaps", "friction"]
    h = 1e-6
    last = steps[-1].solution
    for dp, data in [([1.0, 0.0], ("gap",)), ([0.0, 1.0], ("friction",))]:
        ends = [states(**{name: {"gap": 0.0, "friction": 0.3}[name] + s * h for name in data})[1][-1].solution for s in (1, -1)]
        rates = found.jvp(dp)
        for rate, name in zip(rates, ["displacements", "pressures", "tractions"]):
            difference = (getattr(ends[0], name) - getattr(ends[1], name)) / (2 * h)
            np.testing.assert_allclose(rate, difference, atol=1e-5 * np.abs(difference).max() + 1e-9)
        w = [np.ones_like(rate) for rate in rates]
        assert found.vjp(*w) @ dp == pytest.approx(sum(rate.sum() for rate in rates), rel=1e-8)
    # A step alone measures its slips from the step before: it is no solution of the problem at rest.
    with pytest.raises(ss.SemismoothError, match="no solution"):
        last.sensitivity(gaps=ones).jvp([1.0])
    with pytest.raises(ValueError, match="different problems"):
        ss.history_sensitivity(derivative_problem().solve(0.2), steps, gaps=ones)
    with pytest.raises(ss.SemismoothError, match="history variables"):
        worn = derivative_problem(friction=ss.Friction.exponential(0.4, 0.2, 0.1))
        first = worn.solve(0.0)
        ss.history_sensitivity(first, ss.evolve(worn, first, [0.1]), gaps=True)
