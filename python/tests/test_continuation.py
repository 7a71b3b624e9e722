"""Curves through kinks against exact solutions."""

import json
import os
import pathlib
import re
import signal
import threading

import numpy as np
import pytest
import semismooth as ss


def beam(x):
    """Slopes 1, −1/4 and 39/4, with kinks at y = 1 (load 1) and y = 3 (load 1/2)."""
    y, load = x
    return [y - 1.25 * ss.maximum(y - 1, 0) + 10 * ss.maximum(y - 3, 0) - load]


def test_kinks_of_a_polygon_are_found_and_classified():
    branch = ss.follow(beam, [0.0, 0.0], parameter_range=(0.0, 2.0))
    assert [t.kind for t in branch.transitions] == ["fold", "fold"]
    np.testing.assert_allclose([t.x for t in branch.transitions], [[1.0, 1.0], [3.0, 0.5]], atol=1e-12)
    assert [(f.kind, round(f.parameter, 12)) for f in branch.folds] == [("kink", 1.0), ("kink", 0.5)]
    first = branch.transitions[0]
    assert (first.before, first.after, first.sites) == (["second", "second"], ["first", "second"], [0])
    assert first.complete and first.arms.shape == (1, 2) and first.followed == 0
    np.testing.assert_allclose(first.tangent_before, [0.5**0.5, 0.5**0.5], rtol=1e-12)
    np.testing.assert_allclose(first.tangent_after, [16 / 17**0.5 / 4, -(17**-0.5)], rtol=1e-12)
    assert branch.termination == "bound of the parameter"


def test_arrays_describe_the_polygon():
    branch = ss.follow(beam, [0.0, 0.0], parameter_range=(0.0, 2.0))
    points, k = branch.points, len(branch)
    assert points.shape == branch.tangents.shape == (k, 2)
    assert branch.parameter.shape == branch.arclength.shape == (k,)
    assert len(branch.pieces) == len(branch.events) == len(branch.det_signs) == k
    np.testing.assert_allclose([beam(p)[0] for p in points], 0, atol=1e-12)
    np.testing.assert_array_equal(branch.parameter, points[:, 1])
    # The curve is a polygon, so that chords add up to its length.
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(branch.arclength, np.concatenate([[0.0], np.cumsum(chords)]), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(branch.tangents, axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose((np.diff(points, axis=0) / chords[:, None])[0], branch.tangents[0], atol=1e-9)
    # At kinks they are those of departure.
    for (y, _), tangent, pieces, sign in zip(points, branch.tangents, branch.pieces, branch.det_signs):
        assert pieces == ["first" if y > 1 - 1e-9 else "second", "first" if y > 3 - 1e-9 else "second"]
        assert sign == (-1 if 1 - 1e-9 < y < 3 - 1e-9 else 1)
        slope = 1 - 1.25 * (y > 1 - 1e-9) + 10 * (y > 3 - 1e-9)
        np.testing.assert_allclose(tangent, np.array([1, slope]) / np.hypot(1, slope), rtol=1e-9)
    assert branch.points[-1] == pytest.approx([3 + 1.5 / 9.75, 2.0], abs=1e-12)


def test_smooth_folds_of_a_cubic_are_where_its_derivative_vanishes():
    cubic = ss.follow(lambda x: [x[0] ** 3 - 3 * x[0] - x[1]], [-2.5, -8.125], parameter_range=(-8.125, 8.125))
    assert [f.kind for f in cubic.folds] == ["smooth", "smooth"]
    np.testing.assert_allclose([f.x for f in cubic.folds], [[-1.0, 2.0], [1.0, -2.0]], atol=1e-8)
    assert cubic.transitions == []


@pytest.mark.parametrize("form", ["traced", "dense", "sparse", "differences"])
def test_smooth_functions_are_followed_with_any_jacobian(form):
    scipy_sparse = pytest.importorskip("scipy.sparse")

    def circle(x):
        return np.array([x[0] ** 2 + x[1] ** 2 - 1])

    def derivative(x):
        return np.array([[2 * x[0], 2 * x[1]]])

    jac = {"traced": None, "dense": derivative, "sparse": lambda x: scipy_sparse.csr_matrix(derivative(x)), "differences": "differences"}
    branch = ss.follow(circle, [0.6, 0.8], jac=jac[form], direction="decreasing")
    assert branch.termination == "closed curve"
    np.testing.assert_allclose(np.hypot(*branch.points.T), 1, rtol=1e-9)
    np.testing.assert_allclose(sorted(f.parameter for f in branch.folds), [-1, 1], atol=1e-7)


def test_parametric_complementarity_problems_change_their_bounds():
    # 0 ≤ y ≤ 1 with F = y − α: y = clip(α, 0, 1).
    for jac in (None, lambda x: np.array([[1.0, -1.0]])):
        branch = ss.follow(lambda x: [x[0] - x[1]], [0.0, -1.0], (-1.0, 2.0), jac=jac, lower=0.0, upper=1.0)
        assert [t.kind for t in branch.transitions] == ["pass-through"] * 2
        np.testing.assert_allclose([t.x for t in branch.transitions], [[0.0, 0.0], [1.0, 1.0]], atol=1e-12)
        assert [t.before for t in branch.transitions] == [["lower"], ["interior"]]
        assert branch.transitions[-1].after == ["upper"]


def test_targets_monitors_and_stops_are_hit():
    calls = []

    def height(x):
        calls.append(1)
        return x[0] - 2.0

    traced = ss.trace(lambda x: x[0] - 0.5, 2)
    branch = ss.follow(
        beam,
        [0.0, 0.0],
        (0.0, 2.0),
        targets=[0.25],
        monitors={"half": traced},
        stops={"two": height},
    )
    assert [(c.name, round(float(c.x[0]), 12)) for c in branch.crossings] == [("half", 0.5), ("two", 2.0)]
    assert branch.termination == "zero of a monitor" and calls
    (at,) = np.flatnonzero(branch.parameter == 0.25)
    np.testing.assert_allclose(branch.points[at], [0.25, 0.25], atol=1e-12)
    # Zeros of monitors are events of their names; all rows are those of the crate's tables.
    names = ["fold", "half", "point", "two"]
    assert sorted(set(branch.events)) == names and branch.events[0] == "point"


def test_both_arms_of_a_pitchfork_can_be_followed():
    pitchfork = ss.trace(lambda x: [x[0] ** 3 - x[1] * x[0]], 2)
    branch = ss.follow(pitchfork, [0.0, -0.5], (-0.5, 1.0))
    (point,) = branch.branch_points
    np.testing.assert_allclose(point.x, 0, atol=1e-8)
    assert point.arms.shape == (3, 2)
    ends = sorted(ss.follow(pitchfork, point.x, (-0.5, 1.0), direction=arm).points[-1, 0] for arm in point.arms)
    np.testing.assert_allclose(ends, [-1.0, 0.0, 1.0], atol=1e-8)


def test_where_makes_a_curve_of_two_formulas():
    # y² below 1, 3 y − 2 above: the slope jumps, the parameter goes on.
    branch = ss.follow(lambda x: [ss.where(x[0] < 1, x[0] ** 2, 3 * x[0] - 2) - x[1]], [0.5, 0.25], (0.1, 4.0))
    assert [t.kind for t in branch.transitions] == ["pass-through"]
    np.testing.assert_allclose(branch.transitions[0].x, [1.0, 1.0], atol=1e-12)
    assert branch.points[-1] == pytest.approx([2.0, 4.0], abs=1e-12)


def test_diagrams_hold_all_arms_and_list_solutions():
    diagram = ss.diagram(lambda x: [x[0] ** 3 - x[1] * x[0]], [[0.0, -0.5]], parameter_range=(-1.0, 1.0))
    assert not diagram.limited and diagram.completeness == "nothing else was found within the bounds"
    np.testing.assert_allclose(np.sort(diagram.solutions_at(0.49)[:, 0]), [-0.7, 0.0, 0.7], atol=1e-12)
    assert diagram.solutions_at(-0.25).shape == (1, 2)
    (center,) = [v for v in diagram.vertices if v.kind == "branch point"]
    assert len(center.edges) == 4 and None not in center.edges
    for edge in diagram.edges:
        for end, at in zip(edge.ends, (0, -1)):
            np.testing.assert_allclose(edge.points[at], diagram.vertices[end].x, atol=1e-7)
    assert sorted(e for branch in diagram.branches for e, _ in branch) == list(range(len(diagram.edges)))
    limited = ss.diagram(lambda x: [x[0] ** 3 - x[1] * x[0]], [[0.0, -0.5]], (-1.0, 1.0), max_edges=1)
    assert limited.limited and "edge limit" in limited.completeness


def test_monitors_and_callbacks_of_diagrams():
    seen = []
    kinked = ss.trace(lambda x: x[0] - 0.5, 2)
    diagram = ss.diagram(
        lambda x: [abs(x[0]) + abs(x[1]) - 1],
        [[0.5, 0.5]],
        parameter_range=(-2.0, 2.0),
        monitors={"half": kinked, "sum": lambda x: x[0] + x[1] - 0.25, "never": lambda x: 1.0 + x[0] ** 2},
        callback=seen.append,
    )
    # On the diamond y = 1/2 at α = ±1/2, and y + α = 1/4 at (5/8, −3/8) and (−3/8, 5/8).
    found = sorted((c.name, *c.x.round(10)) for c in diagram.crossings)
    assert found == [("half", 0.5, -0.5), ("half", 0.5, 0.5), ("sum", -0.375, 0.625), ("sum", 0.625, -0.375)]
    for c in diagram.crossings:
        # As long as the edge runs from its end.
        start = diagram.edges[c.edge].points[0]
        assert c.arclength == pytest.approx(np.linalg.norm(c.x - start), abs=1e-9) and c.parameter == c.x[-1]
    assert {"point", "fold", "pass-through"} <= {e["event"] for e in seen}
    assert all(abs(e["x"][0]) + abs(e["x"][1]) == pytest.approx(1, abs=1e-9) for e in seen)
    stopped = ss.diagram(lambda x: [abs(x[0]) + abs(x[1]) - 1], [[0.5, 0.5]], callback=lambda e: True)
    assert stopped.limited and "interrupted" in stopped.completeness
    error = KeyError("mine")

    def failing(x):
        raise error

    for option in [{"callback": failing}, {"monitors": {"m": failing}}]:
        with pytest.raises(KeyError) as caught:
            ss.diagram(lambda x: [abs(x[0]) + abs(x[1]) - 1], [[0.5, 0.5]], **option)
        assert caught.value is error


def test_circles_are_isolas():
    diagram = ss.diagram(lambda x: [abs(x[0]) + abs(x[1]) - 1], [[0.5, 0.5]], parameter_range=(-2.0, 2.0))
    assert len(diagram.isolas) == 1
    assert sorted(round(f.parameter, 12) for f in diagram.folds) == [-1.0, 1.0]


# Problems of the talk of Haslinger, Janovský and Ligurský: p contact nodes with Coulomb friction; solutions in exact arithmetic.
CRATE = pathlib.Path(__file__).parents[2]
CASES = json.loads((CRATE / "tests" / "data" / "seed_examples.json").read_text(encoding="utf-8"))["cases"]
WINDOW = (0.05, 10.0)


def friction(case):
    """H(u, λν, λt, α), lengths n, p, p, 1."""
    A, f0, f1, Bnu, Bt, F0, F1 = (np.array(case[key]) for key in ("A", "f0", "f1", "Bnu", "Bt", "F0", "F1"))
    n, p = len(A), len(Bnu)

    def H(x):
        u, pressure, tangential, alpha = x[:n], x[n : n + p], x[n + p : n + 2 * p], x[-1]
        bound = (F0 + alpha * F1) * pressure
        return np.concatenate(
            [
                A @ u + Bnu.T @ pressure + Bt.T @ tangential - f0 - alpha * f1,
                pressure - ss.maximum(pressure + Bnu @ u, 0),
                tangential - ss.clip(tangential + Bt @ u, -bound, bound),
            ]
        )

    return ss.trace(H, n + 2 * p + 1)


def inside(alpha):
    return WINDOW[0] < alpha < WINDOW[1]


def point(entry, alpha):
    return entry["u"] + entry["lam_nu"] + entry["lam_t"] + [alpha]


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_friction_problems_of_the_talk_have_the_vertices_and_solutions_of_exact_arithmetic(case):
    levels = [(a, [point(s, a) for s in found]) for a, found in zip(case["alphas"], case["solutions"]) if inside(a)]
    diagram = ss.diagram(friction(case), [s for _, found in levels for s in found], WINDOW)
    assert not diagram.limited
    vertices = np.array([v.x for v in diagram.vertices])
    for expected in filter(lambda v: inside(v["alpha"]), case["graph"]["vertices"]):
        distance = np.abs(vertices - point(expected, expected["alpha"])).max(axis=1)
        nearest = diagram.vertices[distance.argmin()]
        assert distance.min() < 1e-10
        assert (nearest.kind == "fold") == expected["fold"]
    for alpha, expected in levels:
        found = diagram.solutions_at(alpha)
        assert len(found) == len(expected)
        for solution in expected:
            assert np.abs(found - solution).max(axis=1).min() < 1e-10


def test_the_load_path_of_a_block_has_the_breakpoints_of_exact_arithmetic():
    # 440 displacements and 11 contact nodes, condensed to traces v = B u = B A⁻¹ (f − Bᵀλ).
    scipy_io = pytest.importorskip("scipy.io")
    folder = CRATE / "examples" / "data" / "block_linear_10x20_F0.5"
    A, Bnu, Bt = (scipy_io.mmread(folder / f"{name}.mtx").toarray() for name in ("A", "Bnu", "Bt"))
    f0, f1, gap = (np.loadtxt(folder / f"{name}.txt") for name in ("f0", "f1", "gap"))
    B, p = np.vstack([Bnu, Bt]), len(gap)
    solved = np.linalg.solve(A, np.column_stack([B.T, f0, f1]))
    C, v0, v1 = B @ solved[:, :-2], B @ solved[:, -2], B @ solved[:, -1]

    def H(x):
        multipliers, alpha = x[:-1], x[-1]
        v = (1 - alpha) * v0 + alpha * v1 - C @ multipliers
        pressure, tangential = multipliers[:p], multipliers[p:]
        return np.concatenate(
            [
                pressure - ss.maximum(pressure + v[:p] - gap, 0),
                tangential - ss.clip(tangential + v[p:], -0.5 * pressure, 0.5 * pressure),
            ]
        )

    branch = ss.follow(H, np.zeros(2 * p + 1), (0.0, 1.0))
    expected = json.loads((folder / "breakpoints_exact.json").read_text(encoding="utf-8"))["events"]
    assert branch.termination == "bound of the parameter" and len(expected) == 36
    np.testing.assert_allclose([t.parameter for t in branch.transitions], [e["gamma"] for e in expected], rtol=1e-9)
    # Rows of pressures come first: a node that opens or closes switches its own.
    for transition, event in zip(branch.transitions, expected):
        site = event["node"] + (0 if 0 in (event["old"], event["new"]) else p)
        assert site in transition.sites
    assert not branch.folds


def test_exceptions_of_all_callbacks_come_out_unchanged():
    error = KeyError("mine")

    def failing(x):
        raise error

    def after(count, work):
        calls = []

        def call(x):
            calls.append(1)
            if len(calls) > count:
                raise error
            return work(x)

        return call

    circle, derivative = lambda x: [x[0] ** 2 + x[1] ** 2 - 1], lambda x: [[2 * x[0], 2 * x[1]]]
    runs = [
        lambda: ss.follow(failing, [1.0, 0.0]),
        lambda: ss.follow(after(20, circle), [1.0, 0.0], jac=derivative),
        lambda: ss.follow(circle, [1.0, 0.0], jac=after(20, derivative)),
        lambda: ss.follow(after(20, circle), [1.0, 0.0], jac="differences"),
        lambda: ss.follow(circle, [1.0, 0.0], monitors={"m": after(3, lambda x: 1.0)}),
        lambda: ss.follow(circle, [1.0, 0.0], stops={"m": failing}),
        lambda: ss.follow(circle, [1.0, 0.0], callback=after(3, lambda e: False)),
        lambda: ss.diagram(after(20, circle), [[1.0, 0.0]], jac=derivative),
    ]
    for run in runs:
        with pytest.raises(KeyError) as caught:
            run()
        assert caught.value is error


def test_a_callback_sees_every_point_and_stops():
    seen = []
    branch = ss.follow(beam, [0.0, 0.0], (0.0, 2.0), callback=seen.append)
    assert [e["event"] for e in seen] == branch.events
    np.testing.assert_array_equal([e["x"] for e in seen], branch.points)
    stopped = ss.follow(beam, [0.0, 0.0], (0.0, 2.0), callback=lambda e: e["event"] == "fold")
    assert stopped.termination == "interrupted" and len(stopped.transitions) == 1


@pytest.mark.parametrize("called", [False, True])
def test_ctrl_c_ends_a_curve(called):
    # A helix of small steps.
    def helix(x):
        return [x[0] - np.sin(50 * x[2]), x[1] - np.cos(50 * x[2])]

    def derivative(x):
        return [[1.0, 0.0, -50 * np.cos(50 * x[2])], [0.0, 1.0, 50 * np.sin(50 * x[2])]]

    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        timer.start()
        ss.follow(helix, [0.0, 1.0, 0.0], jac=derivative if called else None, max_step=1e-3, step=1e-3, max_points=10**9, max_growth=1e300)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: ss.follow(beam, [0.0]), ValueError, "at least two"),
        (lambda: ss.follow(ss.trace(beam, 2), [0.0, 0.0, 0.0]), ValueError, "must give 2 values for 3"),
        (lambda: ss.follow(beam, [0.0, 0.0], (2.0, 1.0)), ss.SemismoothError, "parameter_range"),
        (lambda: ss.follow(beam, [0.0, 0.0], direction="up"), ValueError, "increasing"),
        (lambda: ss.follow(beam, [0.0, 0.0], direction=[1.0]), ss.SemismoothError, "length"),
        (lambda: ss.follow(beam, [0.0, 0.0], stepp=1), TypeError, "max_step"),
        (lambda: ss.follow(beam, [0.0, 0.0], lower=0.0), ValueError, "kinks"),
        (lambda: ss.follow(beam, [0.0, 0.0], monitors={"m": 3}), TypeError, "monitor m"),
        (lambda: ss.follow(beam, [0.0, 0.0], monitors={"m": ss.trace(lambda x: x, 2)}), ValueError, "monitor m"),
        (lambda: ss.follow(lambda x: [x[0] ** 2 + 1 - 0 * x[1]], [0.0, 0.0]), ss.SemismoothError, "start"),
        (lambda: ss.diagram(beam, np.zeros((0, 2))), ValueError, "start"),
        (lambda: ss.diagram(beam, [[0.0, 0.0]], (0.0, 1.0)).solutions_at(3.0), ss.SemismoothError, "range"),
    ],
)
def test_misuse_is_refused_with_the_reason(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_tables_hold_a_row_for_each_point():
    pytest.importorskip("pandas")
    branch = ss.follow(beam, [0.0, 0.0], (0.0, 2.0))
    table = branch.to_pandas()
    assert list(table.columns) == ["arclength", "x0", "parameter", "event", "site0", "site1"]
    assert len(table) == len(branch)
    folds = table[table.event == "fold"]
    np.testing.assert_allclose(folds[["x0", "parameter"]], [[1.0, 1.0], [3.0, 0.5]], atol=1e-12)


def test_tables_of_diagrams_hold_a_row_for_each_point():
    pandas = pytest.importorskip("pandas")
    diagram = ss.diagram(lambda x: [abs(x[0]) + x[0] / 2 - x[1]], [[1.0, 1.5]], (-1.0, 2.0))
    table = diagram.to_pandas()
    assert list(table.columns) == ["edge", "arclength", "x0", "parameter", "event", "det", "site0"]
    for e, edge in enumerate(diagram.edges):
        rows = table[table.edge == e]
        np.testing.assert_array_equal(rows[["x0", "parameter"]], edge.points)
        assert list(rows.det.array) == [s if s is not None else pandas.NA for s in edge.point_det_signs]
        assert set(rows.site0) == set(edge.pieces)
        assert [rows.event.iloc[0], rows.event.iloc[-1]] == [diagram.vertices[v].kind for v in edge.ends]
    # y = |a| has its isolated solution where the two parts of y² = −a² meet.
    point = ss.diagram(lambda x: [abs(x[0]) + abs(x[1])], [[0.0, 0.0]], (-1.0, 1.0)).to_pandas()
    assert point.edge.isna().all() and list(point.event) == ["isolated"]


def signs_of_the_crate():
    """The symbols of `Marker` in the crate, by the first character of their documentation, and the constants of `Colour`."""
    source = (CRATE / "src" / "output" / "diagram.rs").read_text(encoding="utf-8")
    names = dict(re.findall(r'Self::(\w+) => "([^"]+)"', source))
    body = source[source.index("pub enum Marker {") :]
    signs = re.findall(r"/// (\S) [^\n]*\n    (\w+),", body[: body.index("\n}")])
    colours = re.findall(r"pub const (\w+): Self = Self::new\(0x(\w+), 0x(\w+), 0x(\w+)\)", source)
    return {names[kind]: sign for sign, kind in signs}, {name: "#" + "".join(parts) for name, *parts in colours}


def test_signs_and_colours_are_those_of_the_crate():
    from semismooth import _views

    signs, colours = signs_of_the_crate()
    drawn = {"○": ("o", "white"), "△": ("^", "white"), "□": ("s", "white"), "◇": ("D", "white"), "◆": ("D", "black")}
    drawn |= {"×": ("x", "black"), "●": ("o", "black"), "⊗": ("$\\otimes$", "black"), "◉": ("$\\odot$", "black"), "✱": ((6, 2, 0), "black"), "＋": ("+", "black")}
    assert {kind: (m, fill) for kind, (m, _, fill) in _views._MARKERS.items()} == {kind: drawn[s] for kind, s in signs.items()}
    assert list(_views._COLOURS) == [colours[name] for name in ("BLUE", "RED", "GREEN", "PURPLE", "GREY")]
    assert set(_views._KINDS.values()) == set(signs) - {"value"}


def test_affine_formulas_are_followed_from_kink_to_kink():
    branch = ss.follow(beam, [0.0, 0.0], parameter_range=(0.0, 2.0))
    assert len(branch) == 4
    np.testing.assert_allclose(branch.points, [[0, 0], [1, 1], [3, 0.5], [3 + 1.5 / 9.75, 2]], atol=1e-12)

    # Any other term, however small, makes a formula curved; constants and factors that vanish do not.
    def softening(x, term):
        return [x[0] - 1.25 * ss.maximum(x[0] - 1, 0) + term(*x) - x[1]]

    def length(term):
        return len(ss.follow(lambda x: softening(x, term), [0.0, 0.0], (0.0, 0.9)))

    straight = [
        lambda y, a: 0 * y * a,
        lambda y, a: y / 2 - (np.sqrt(2) * y) ** 1 / 3,
        lambda y, a: ss.minimum(y, 5) / 7 + abs(y + 9) / 9 - 1,
        lambda y, a: ss.where(y < 1, y, 2 * y - 1) / 9,
        lambda y, a: ss.clip(y, -8, 8) / 9,
    ]
    assert [length(term) for term in straight] == [2] * len(straight)
    curved = [lambda y, a: 1e-13 * y * a, lambda y, a: 1e-13 * y**2, lambda y, a: 1e-13 * np.sin(y), lambda y, a: 1e-13 * y / (y + 9)]
    assert min(length(term) for term in curved) > 5


def test_pictures_are_smooth_between_kinks():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    def drawn(found, **options):
        ax = found.plot(ax=pyplot.figure().add_subplot(), **options)
        return [line.get_xydata() for line in ax.lines if line.get_linestyle() in ("-", "--") and len(line.get_xdata())]

    # A part of a circle in a few steps: cubics are far nearer than chords.
    circle = ss.trace(lambda x: [x[0] ** 2 + x[1] ** 2 - 1], 2)
    branch = ss.follow(circle, [0.6, -0.8], max_arclength=2.4, min_cos=0.7, step=0.5)
    (line,) = drawn(branch)
    off = np.abs(np.linalg.norm(line, axis=1) - 1)
    chords = np.linalg.norm(0.5 * (branch.points[1:] + branch.points[:-1]), axis=1)
    assert len(line) > 5 * len(branch) and 1 - chords.min() > 0.02 and off.max() < 0.1 * (1 - chords.min())
    # What is drawn may be a function.
    (line,) = drawn(branch, y=lambda x: 3 * x[0] ** 2)
    np.testing.assert_allclose(line[:, 1], 3 * (1 - line[:, 0] ** 2), atol=0.05)
    # Polygons have their corners only, and so have edges of diagrams.
    polygon = drawn(ss.follow(beam, [0.0, 0.0], (0.0, 2.0)))
    assert [len(part) for part in polygon] == [2, 2, 2]
    parabola = ss.diagram(lambda x: [x[0] ** 2 - x[1]], [[0.5, 0.25]], (-1.0, 1.0))
    for part in drawn(parabola):
        np.testing.assert_allclose(part[:, 0], part[:, 1] ** 2, atol=2e-3)
    pyplot.close("all")


def test_pictures_dash_negative_determinants_and_mark_events():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    # Where steps are long, no regular point lies between the folds.
    long = ss.follow(beam, [0.0, 0.0], (0.0, 2.0), step=10.0, max_step=10.0)
    lines = long.plot(ax=pyplot.figure().add_subplot()).lines
    drawn = [line for line in lines if line.get_linestyle() in ("-", "--") and len(line.get_xdata())]
    assert [line.get_linestyle() for line in drawn] == ["-", "--", "-"]
    # A colour for each pair of pieces.
    assert len({line.get_color() for line in drawn}) == 3
    branch = ss.follow(beam, [0.0, 0.0], (0.0, 2.0))
    ax = branch.plot(y=lambda x: 2 * x[0])
    lines = [line for line in ax.lines if line.get_linestyle() in ("-", "--") and len(line.get_xdata())]
    assert [line.get_linestyle() for line in lines] == ["-", "--", "-"]
    np.testing.assert_allclose([lines[1].get_xydata()[0], lines[1].get_xydata()[-1]], [[1.0, 2.0], [0.5, 6.0]], atol=1e-12)
    pieces = ["0, 0", "x[0] − 1, 0", "x[0] − 1, x[0] − 3"]
    assert ax.get_legend_handles_labels()[1] == [*pieces, "fold", "start", "det < 0"] and ax.get_xlabel() == "parameter"
    assert {line.get_color() for line in branch.plot(ax=pyplot.figure().add_subplot(), color="green").lines[:3]} == {"green"}
    diagram = ss.diagram(lambda x: [x[0] ** 3 - x[1] * x[0]], [[0.0, -0.5]], (-1.0, 1.0))
    assert diagram.plot(ax=pyplot.figure().add_subplot()).get_legend_handles_labels()[1] == ["branching", "start", "det < 0"]
    pyplot.close("all")
