"""Bodies given by matrices, and bodies of revolution."""

import pickle
import sys
import types

import numpy as np
import pytest
import semismooth as ss
from scipy import sparse


def block():
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [8, 4])
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={"left": 0.0})
    load = body.traction("top", lambda x: [0, -0.01 - 0.004 * x[0]]) + body.body_force([0.001, -0.003])
    rate = body.traction("right", [0.01, 0.002])
    whole = ss.ContactProblem(body, "bottom", ss.Foundation.gap(lambda x: 1e-4 * x[0] ** 2), 0.3, load=load, rate=rate)
    # Free displacements are numbered node by node, component by component; those of x = 0 are fixed.
    free = np.flatnonzero(np.repeat(mesh.points[:, 0] > 0, 2))
    number = np.full(2 * mesh.num_nodes, -1)
    number[free] = np.arange(len(free))
    rows = [sparse.lil_matrix((whole.num_contacts, len(free))) for _ in range(2)]
    for i, node in enumerate(whole.nodes):
        for d in range(2):
            rows[0][i, number[2 * node + d]] = whole.normals[i, d]
            rows[1][i, number[2 * node + d]] = whole.tangents[0][i, d]
    return whole, sparse.csc_matrix(body.stiffness), rows, load.forces, rate.forces


def test_matrices_give_the_solutions_of_their_mesh():
    whole, a, (bnu, bt), f0, f1 = block()
    given = ss.ContactProblem.from_matrices(a, bnu, [bt], 0.3, load=f0, rate=f1, gap=whole.gaps, points=whole.points)
    assert given.body is None and given.notes == []
    np.testing.assert_array_equal(given.points, whole.points)
    for dense in (given, ss.ContactProblem.from_matrices(a.toarray(), bnu.toarray(), [bt.toarray()], 0.3, load=f0, rate=f1, gap=whole.gaps)):
        for alpha in (0.0, 1.0):
            x, y = whole.solve(alpha), dense.solve(alpha)
            assert x.states == y.states
            np.testing.assert_allclose(y.x, x.x, rtol=0, atol=1e-13)
    assert len(ss.follow(given, given.solve(0.0), parameter_range=(0, 1)).transitions) == len(
        ss.follow(whole, whole.solve(0.0), parameter_range=(0, 1)).transitions
    )
    full = ss.ContactProblem.from_matrices(a, bnu, [bt], 0.3, load=f0, rate=f1, gap=whole.gaps, form="full")
    np.testing.assert_allclose(full.solve(1.0).pressures, whole.solve(1.0).pressures, rtol=0, atol=1e-12)
    again = pickle.loads(pickle.dumps(given.solve(1.0)))
    np.testing.assert_array_equal(again.x, given.solve(1.0).x)


def test_problems_of_matrices_are_saved_in_files(tmp_path):
    whole, a, (bnu, bt), f0, f1 = block()
    given = ss.ContactProblem.from_matrices(a, bnu, [bt], 0.3, load=f0, rate=f1, gap=whole.gaps)
    ss.save(given.solve(1.0), tmp_path / "solution.json")
    np.testing.assert_array_equal(ss.load(tmp_path / "solution.json").x, given.solve(1.0).x)


def test_a_superelement_equals_the_whole_mesh():
    """Guyan (1965): interior displacements eliminated, interior loads condensed, too."""
    whole, a, (bnu, bt), f0, f1 = block()
    a, bnu, bt = a.toarray(), bnu.toarray(), bt.toarray()
    kept = np.flatnonzero(abs(bnu).sum(0) + abs(bt).sum(0))
    inner = np.setdiff1d(np.arange(len(a)), kept)
    through = np.linalg.solve(a[np.ix_(inner, inner)], np.column_stack([a[np.ix_(inner, kept)], f0[inner], f1[inner]]))
    small = a[np.ix_(kept, kept)] - a[np.ix_(kept, inner)] @ through[:, :-2]
    f0, f1 = (f[kept] - a[np.ix_(kept, inner)] @ through[:, k] for f, k in ((f0, -2), (f1, -1)))
    element = ss.ContactProblem.from_matrices(small, bnu[:, kept], [bt[:, kept]], 0.3, load=f0, rate=f1, gap=whole.gaps)
    for alpha in (0.0, 0.5, 1.0):
        x, y = whole.solve(alpha), element.solve(alpha)
        assert x.states == y.states and len(set(x.states)) > 1
        size = abs(x.pressures).max()
        np.testing.assert_allclose(y.pressures, x.pressures, rtol=0, atol=1e-12 * size)
        np.testing.assert_allclose(y.tractions, x.tractions, rtol=0, atol=1e-12 * size)
        np.testing.assert_allclose(y.displacements, x.displacements[whole.nodes].ravel(), rtol=0, atol=1e-12)


def test_what_is_unsymmetric_is_told():
    whole, a, (bnu, bt), f0, f1 = block()
    lower = sparse.tril(a, -1)
    with pytest.warns(UserWarning, match="not symmetric.*symmetric part"):
        rounded = ss.ContactProblem.from_matrices(a + 1e-8 * lower, bnu, [bt], 0.3, load=f0, rate=f1, gap=whole.gaps)
    assert "differ by" in rounded.notes[0]
    np.testing.assert_allclose(rounded.solve(1.0).pressures, whole.solve(1.0).pressures, rtol=0, atol=1e-8)
    with pytest.raises(ss.SemismoothError, match="symmetric"):
        ss.ContactProblem.from_matrices(a + 1e-3 * lower, bnu, [bt], 0.3, load=f0, rate=f1)


def test_what_is_wrong_with_matrices_is_named():
    whole, a, (bnu, bt), f0, f1 = block()
    make = ss.ContactProblem.from_matrices
    for wrong, words in [
        (lambda: make(a, bnu[:, 1:], [bt], 0.3), "normal trace is 8 x 79"),
        (lambda: make(a, bnu, [], 0.3), "tangential"),
        (lambda: make(a, bnu, [bt], 0.3, load=f0[1:]), "load"),
        (lambda: make(a, bnu, [bt], 0.3, gap=[0.0]), "gap"),
        (lambda: make(a, bnu, [bt], np.ones(3)), "friction"),
        (lambda: make(-a, bnu, [bt], 0.3), "definite|unsupported|not supported|energy"),
        (lambda: make(a, 0 * bnu, [bt], 0.3), "rank"),
        (lambda: make(a, bnu, [bt], 0.3).solve().stresses, "no stresses"),
        (lambda: make(a, bnu, [bt], 0.3).normals, "no normals"),
        (lambda: make(a, bnu, [bt], 0.3).points, "points"),
    ]:
        with pytest.raises(ss.SemismoothError, match=words):
            wrong()
    with pytest.raises(ValueError, match="form"):
        make(a, bnu, [bt], 0.3, form="reduced")
    with pytest.raises(ValueError, match=r"\(3, 2\), expected \(8, 2\)"):
        make(a, bnu, [bt], 0.3, points=np.zeros((3, 2)))
    with pytest.raises(TypeError, match="stiffness must be a matrix"):
        make("A", bnu, [bt], 0.3)


def test_substructures_are_read(tmp_path):
    text = "**\n*USER ELEMENT,NODES=2,LINEAR\n** ELEMENT NODES\n** 17, 5\n1, 2\n2, 2\n*MATRIX,TYPE=STIFFNESS\n4.,\n1., 3.\n.5, .25, 2.\n"
    (tmp_path / "sub.mtx").write_text(text)
    found = ss.read_substructure(tmp_path / "sub.mtx")
    np.testing.assert_array_equal(found.stiffness.toarray(), [[4, 1, 0.5], [1, 3, 0.25], [0.5, 0.25, 2]])
    assert found.nodes.tolist() == [17, 17, 5] and found.components.tolist() == [0, 1, 1]
    (tmp_path / "sub.mtx").write_text(text.replace("NODES=2", "NODES=3"))
    with pytest.raises(ss.SemismoothError, match="3 announced"):
        ss.read_substructure(tmp_path / "sub.mtx")


def test_op4_is_read_by_pynastran_or_advice_is_given(monkeypatch, tmp_path):
    stiffness = np.diag([2.0, 3.0])
    module = types.ModuleType("pyNastran.op4.op4")
    for found in ((6, stiffness), types.SimpleNamespace(data=stiffness)):
        module.read_op4 = lambda path, debug, found=found: {"KAA": found}
        for name in ("pyNastran", "pyNastran.op4"):
            monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
        monkeypatch.setitem(sys.modules, "pyNastran.op4.op4", module)
        assert ss.read_op4(tmp_path / "k.op4")["KAA"] is stiffness
    for name in ("pyNastran", "pyNastran.op4", "pyNastran.op4.op4"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match="k.op4, install pyNastran"):
        ss.read_op4(tmp_path / "k.op4")


def test_a_tube_under_pressure_is_that_of_lame():
    inner, outer, poisson, pressure = 1.0, 2.0, 0.3, 0.1

    def exact(r):
        share = pressure * inner**2 / (outer**2 - inner**2)
        return share * ((1 - poisson) * r + (1 + poisson) * outer**2 / r)

    errors = []
    for n in (8, 16):
        mesh = ss.Mesh.rectangle([inner, 0], [outer, 0.5], [n, n // 2])
        body = ss.Body(mesh, ss.Material(1.0, poisson), supports={"top": [None, 0.0]}, plane="axisymmetric")
        problem = ss.ContactProblem(body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), None, load=body.traction("left", [pressure, 0]))
        np.testing.assert_allclose(problem.areas.sum(), np.pi * (outer**2 - inner**2), rtol=1e-13)
        solution = problem.solve()
        errors.append(np.sqrt(np.mean((solution.displacements[:, 0] - exact(mesh.points[:, 0])) ** 2)) / exact(inner))
        # It shortens, and leaves the ground: its ends are free.
        assert solution.counts[0] == problem.num_contacts
    assert errors[1] < 0.27 * errors[0] < 0.01, errors
    with pytest.raises(ss.SemismoothError, match="radius"):
        ss.Body(ss.Mesh.rectangle([-1, 0], [1, 1], [2, 2]), ss.Material(1.0, 0.3), supports={"top": 0.0}, plane="axisymmetric")
    with pytest.raises(ValueError, match="plane"):
        ss.Body(ss.Mesh.rectangle([0, 0], [1, 1], [2, 2]), ss.Material(1.0, 0.3), supports={"top": 0.0}, plane="revolved")


def node(normal, shear, law, **more):
    """One node of stiffness 2 in each direction: displacements and forces."""
    problem = ss.ContactProblem.from_matrices(2 * np.eye(2), [[1.0, 0.0]], [[[0.0, 1.0]]], law, load=[normal, shear], **more)
    solution = pickle.loads(pickle.dumps(problem)).solve()
    return [*solution.displacements, *solution.pressures, *solution.tractions[:, 0]]


@pytest.mark.parametrize(
    ("normal", "shear", "law", "springs", "exact"),
    [
        (1.0, 1.0, ss.LimitedShear(0.4, 0.3), None, [0, 0.35, 1, 0.3]),
        (0.5, 1.0, ss.LimitedShear(0.4, 0.3), None, [0, 0.4, 0.5, 0.2]),
        (1.0, 1.0, ss.Cohesion(0.4, 0.5), None, [0, 0.2, 1, 0.6]),
        (-0.2, 1.0, ss.Cohesion(0.4, [0.5]), None, [0, 0.44, -0.2, 0.12]),
        (-1.0, 1.0, ss.Cohesion(ss.LimitedShear(0.4, 1.0), 0.5), None, [-0.25, 0.5, -0.5, 0]),
        (-1.0, 1.0, ss.Bonded(), None, [0, 0, -1, 1]),
        (-1.0, 1.0, ss.Bonded(), (2.0, 1.0), [-0.25, 1 / 3, -0.5, 1 / 3]),
        (1.0, 0.5, 0.4, (2.0, None), [0.25, 0.15, 0.5, 0.2]),
    ],
)
def test_laws_of_one_node(normal, shear, law, springs, exact):
    np.testing.assert_allclose(node(normal, shear, law, springs=springs), exact, rtol=0, atol=1e-12)
    np.testing.assert_allclose(node(normal, shear, law, springs=springs, form="full")[2:], exact[2:], rtol=0, atol=1e-12)


def test_wear_is_k_p_s():
    """A node of stiffness 4 under a dead load of 6, pushed to and fro by 2 without friction."""
    matrices = np.diag([1e-9, 4.0]), [[1.0, 0.0]], [[[0.0, 1.0]]]
    problem = ss.ContactProblem.from_matrices(*matrices, ss.Wear(0.0, 0.1), load=[6.0, 0.0], rate=[0.0, 1.0], form="full")
    steps = ss.evolve(problem, problem.solve(0.0), [8.0, 0.0])
    np.testing.assert_allclose([s.history[0, -1] for s in steps], [0.1 * 6 * 2, 0.1 * 6 * 4], rtol=1e-8)
    # On a mesh it is per area: of a block that moves as a whole under a uniform pressure.
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [4, 2])
    body = ss.Body(mesh, ss.Material(1.0, 0.0), supports={"top": [0.0, None]}, floating=True)
    ground = ss.Foundation.plane([0, 0], [0, 1])
    load, rate = body.traction("top", [0, -0.01]), body.motion("top", [0.3, None])
    problem = ss.ContactProblem(body, "bottom", ground, ss.Wear(0.0, 5.0), load=load, rate=rate)
    (step,) = ss.evolve(problem, problem.solve(0.0), [1.0])
    np.testing.assert_allclose(step.history[:, -1], 5.0 * 0.01 * 0.3, rtol=1e-10)
    with pytest.raises(ss.SemismoothError, match="rate of wear"):
        ss.ContactProblem(body, "bottom", ground, ss.Wear(0.3, -1.0))
    assert repr(ss.Wear(0.3, 2.0)) == "<Wear: coefficient 2.0>"


@pytest.mark.parametrize("law", [0.3, ss.LimitedShear(0.3, 1e-3), ss.Cohesion(0.3, 1e-3), ss.Bonded()])
def test_a_pressed_disc_is_the_same_in_all_forms(law):
    mesh = ss.Mesh.rectangle([0, 0], [1, 1], [12, 12])
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]}, plane="axisymmetric")
    bowl = ss.Foundation.gap(lambda x: 0.05 * x[0] ** 2, normal=[0, -1])
    condensed, full, reduced = (ss.ContactProblem(body, "bottom", bowl, law, form=form).solve() for form in ("condensed", "full", "reduced"))
    # On the axis there is no radial displacement.
    assert condensed.problem.held.sum() == 1
    size = abs(condensed.pressures).max()
    for other in (full, reduced):
        assert other.states == condensed.states
        np.testing.assert_allclose(other.pressures, condensed.pressures, rtol=0, atol=1e-8 * size)
        np.testing.assert_allclose(other.tractions, condensed.tractions, rtol=0, atol=1e-8 * size)


def test_stresses_of_laws_are_forces_over_areas():
    """A block of height 1 without Poisson effect, pressed down by 0.01: the stress is 0.01 / (1 / E + 1 / k) on a layer of stiffness k = 2."""
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [8, 4])
    body = ss.Body(mesh, ss.Material(1.0, 0.0), supports={"top": [0.0, -0.01]})
    ground = ss.Foundation.plane([0, 0], [0, 1])
    layered = ss.ContactProblem(body, "bottom", ground, None, stiffness=(2.0, None)).solve()
    np.testing.assert_allclose(layered.pressures, 0.02 / 3 * layered.problem.areas, rtol=1e-11)
    np.testing.assert_allclose(layered.displacements[layered.problem.nodes, 1], -0.01 / 3, rtol=1e-11)
    limit = ss.LimitedShear(0.3, 1e-4)
    sheared = ss.ContactProblem(body, "bottom", ground, limit, rate=body.motion("top", [0.05, None])).solve(1.0)
    np.testing.assert_allclose(sheared.tractions[:, 0], 1e-4 * sheared.problem.areas, rtol=1e-11)
    glued = ss.ContactProblem(body, "bottom", ground, ss.Cohesion(0.3, 0.1), rate=body.motion("top", [None, 0.05])).solve(1.0)
    np.testing.assert_allclose(glued.pressures, -0.04 * glued.problem.areas, rtol=1e-11)
    for wrong, error in [
        (lambda: ss.ContactProblem(body, "bottom", ground, 0.3, stiffness=(0.0, None)), ValueError),
        (lambda: ss.ContactProblem(body, "bottom", ground, 0.3, stiffness=2.0), TypeError),
        (lambda: ss.ContactProblem(body, "bottom", ground, 0.3, stiffness=(2.0, None), form="reduced"), ValueError),
        (lambda: ss.ContactProblem(body, "bottom", ground, ss.Cohesion(0.3, -1.0)), ss.SemismoothError),
        (lambda: ss.ContactProblem(body, "bottom", ground, ss.LimitedShear(0.3, [1.0])), ValueError),
    ]:
        with pytest.raises(error):
            wrong()


def test_a_block_without_supports_is_held_by_friction():
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [4, 2])
    with pytest.raises(ss.SemismoothError, match="floats"):
        ss.Body(mesh, ss.Material(1.0, 0.3), supports={})
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={}, floating=True)
    load, rate = body.body_force([0, -0.01]), body.body_force([0.01, 0])
    table = ss.Foundation.plane([0, 0], [0, 1])
    for form in ["full", "condensed"]:
        problem = ss.ContactProblem(body, "bottom", table, 0.5, load=load, rate=rate, form=form)
        np.testing.assert_allclose(pickle.loads(pickle.dumps(problem)).solve(0.4).resultant, [0.02, 0.008], rtol=0, atol=1e-10)
        with pytest.raises(ss.SemismoothError, match="nothing balances the load"):
            problem.solve(0.6)
    # Three motions without energy.
    assert problem.num_vars == 2 * problem.num_contacts + 3 + 1


def test_coefficients_in_the_order_of_the_mesh_are_those_of_the_nodes():
    whole = block()[0]
    mesh = whole.body.mesh
    everywhere = 0.1 + 0.2 * mesh.points[:, 0]
    load = whole.body.traction("top", [0, -0.01]) + whole.body.traction("right", [0.004, 0])
    ground = ss.Foundation.plane([0, 0], [0, 1])
    by_mesh, by_contact = (
        ss.ContactProblem(whole.body, "bottom", ground, law, load=load).solve() for law in (everywhere, everywhere[whole.nodes])
    )
    assert by_mesh.counts[2] > 0
    np.testing.assert_array_equal(by_mesh.x, by_contact.x)


def test_op4_of_pynastran(tmp_path):
    op4 = pytest.importorskip("pyNastran.op4.op4")
    stiffness = np.array([[2.0, 0.5], [0.5, 3.0]])
    op4.OP4(debug=False).write_op4(tmp_path / "k.op4", {"KAA": (6, stiffness)}, is_binary=False)
    np.testing.assert_array_equal(ss.read_op4(tmp_path / "k.op4")["KAA"], stiffness)
