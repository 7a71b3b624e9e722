"""Results are data: they can be pickled, copied, sent to other processes, and written to files, and are the same afterwards."""

import copy
import json
import multiprocessing
import pickle

import numpy as np
import pytest
import semismooth as ss
from semismooth import _core


def beam(x):
    y, load = x
    return [y - 1.25 * ss.maximum(y - 1, 0, name="softening") + 10 * ss.maximum(y - 3, 0, name="stop") - load]


def made():
    branch = ss.follow(
        beam, [0.0, 0.0], parameter_range=(0.0, 2.0), monitors={"half": lambda x: x[0] - 0.5}, names=["y", "load"]
    )
    diagram = ss.diagram(lambda x: [x[0] ** 3 - x[1] * x[0]], [0.0, -0.5], parameter_range=(-1.0, 1.0), monitors={"zero": lambda x: x[1] - 0.5})
    mapped = ss.diagram(([[2.0, 1.0]], [0.0]), [0.0, 0.0], parameter_range=(0.0, 1.0), lower=-1.0)
    lists = ss.all_solutions(ss.Lcp([[0.0, -1.0], [1.0, 0.0]], [0.0, 0.0]))
    results = [
        ss.solve(lambda x: abs(x) + 2 * x - 3, 0.0),
        ss.solve_lcp([[2.0, 1.0], [1.0, 2.0]], [-5.0, -1.0]),
        ss.solve_lcp([[0.0]], [-1.0]),
        ss.lemke([[2.0, 1.0], [1.0, 2.0]], [-5.0, -1.0]),
        ss.solve_vi(lambda x: x - 1, [0.0, 0.0], A=[[1.0, 1.0]], b=[1.0]),
        ss.solve_cone(lambda x: x - [0, 3, 4], [("second-order", 3)]),
        ss.solve_friction(np.eye(2), [-1.0, 0.5], [0.3]),
        lists,
        ss.all_solutions(lambda x: [abs(x[0]) - x[0] ** 2 / 4]),
        branch,
        diagram,
        mapped,
        ss.trace(beam, 2),
        ss.Lcp([[2.0]], [1.0], -np.inf, 3.0),
        ss.Mesh.rectangle([0, 0], [2, 1], [2, 1]),
        ss.transition_set(lambda x: [x[0] + ss.maximum(x[0], 0) - x[1] - x[2]], [0.0, 0.0, 0.0], 0, parameter_range=(0.0, 1.0)),
    ]
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [4, 2])
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]}, materials={})
    rate = body.motion("top", [0.05, None])
    friction = ss.Friction.function(lambda slip, parameter: 0.4 * np.exp(-slip))
    problem = ss.ContactProblem(
        body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), friction, rate=rate, paths=[(0.5 * rate - rate, lambda a: a**2)]
    )
    solution = problem.solve(0.0)
    steps = ss.evolve(problem, solution, [0.5, 1.0], slip_increments=True)
    results += [
        body,
        rate + rate,
        -body.traction("right", [0.1, 0.2]),
        body.body_force([0.0, -1.0]),
        ss.Material.lame(1.0, 2.0),
        ss.Material.tensor(ss.Material(1.0, 0.3).components),
        ss.Foundation.gap(0.1, normal=[0.0, -1.0]),
        ss.Mortar("top", gap=0.1, reach=2.0),
        ss.ContactProblem(body, "bottom", ss.Foundation.gap(0.0), 0.3, multipliers=(body.mesh, "bottom"), degree="continuous"),
        friction,
        ss.Friction.table([0.0, 1.0], [0.5, 0.3]),
        ss.Friction.exponential(0.5, 0.3, 0.1).scaled(),
        ss.Friction(0.3, 0.1),
        ss.GivenBound(0.2),
        ss.LimitedShear(0.3, 0.1),
        ss.Cohesion(ss.Friction(0.3), 0.1),
        ss.Wear(ss.Friction(0.3), 0.1),
        ss.Bonded(),
        problem,
        problem.with_second_parameter(rate),
        ss.ContactProblem(body, "bottom", ss.Foundation.gap(0.0), 0.3, form="reduced"),
        solution,
        steps[-1],
        ss.follow(problem, solution, parameter_range=(0.0, 0.5)),
        ss.diagram(problem, solution, parameter_range=(0.0, 0.5)),
    ]
    M, q = np.stack([np.eye(2), -np.eye(2)]), np.array([[-1.0, 1.0], [-1.0, 1.0]])
    grow = ss.follow_equilibria(lambda x: [x[2] * x[0] - x[1], x[0] + x[2] * x[1] - abs(x[2] - 0.5) * 0], [0.0, 0.0, -1.0], (-1.0, 1.0))
    kinked = ss.follow_equilibria(lambda x: [x[1] - abs(x[0])], [1.0, 1.0], (-1.0, 1.0), "decreasing")
    results += [
        ss.solve_lcp(M, q),
        ss.solve_lcp(np.zeros((2, 0, 0)), np.zeros((2, 0))),
        ss.solve_mcp(lambda x, p: x - p, 0, [[1.0], [2.0]], 0.0, params=[[0.5], [np.nan]]),
        ss.solve_mcp(lambda x, p: x - p, 0, 1, 0.0, params=[[0.5], [0.6], [0.7]]),
        ss.sensitivity(lambda x, p: x - p, [[0.5], [0.6]], [[0.5], [0.6]]),
        ss.solve_friction(np.eye(2), [-1.0, 0.5], [[0.3], [np.nan]]),
        ss.minimise(lambda q, p: p * (p + q - 10), lambda q, p: 2 * q + p - 10, 1.0, 1.0, lower=0.0, p_lower=0.0, p_upper=20.0),
        grow,
        kinked,
        grow.hopf[0],
        kinked.kinks[0],
        ss.spectrum(lambda x: [x[2] * x[0] - x[1], x[0] + x[2] * x[1]], [0.0, 0.0, -0.5]),
    ]
    results += [ss.sensitivity(lambda x, p: abs(x) + 2 * x - p, 1.0, 3.0), ss.solve_mcp(lambda x, p: x - p, 0, 1, 0.0, params=0.5)]
    parts = [*branch.transitions, *branch.folds, *branch.crossings, *diagram.vertices, *diagram.edges, *diagram.crossings, *lists.solutions]
    return results + parts + list(lists.continua)


def state(result):
    """All data of a result, with those of its parts."""
    if type(result).__name__ in _core._saved_classes():
        return type(result).__name__, {key: state(value) for key, value in _core._state(result).items()}
    if isinstance(result, np.ndarray):
        return result.shape, result.dtype.str, result.tobytes()
    if isinstance(result, dict):
        return {key: state(value) for key, value in result.items()}
    if isinstance(result, (list, tuple)):
        return [state(value) for value in result]
    return "nan" if result != result else result


RESULTS = made()
IDS = [f"{k}-{type(r).__name__}" for k, r in enumerate(RESULTS)]


@pytest.mark.parametrize("result", RESULTS, ids=IDS)
def test_pickles_and_copies_have_the_same_data(result):
    for again in (pickle.loads(pickle.dumps(result)), copy.copy(result), copy.deepcopy(result)):
        assert type(again) is type(result) and repr(again) == repr(result)
        assert state(again) == state(result)


@pytest.mark.parametrize("result", RESULTS, ids=IDS)
def test_files_keep_every_digit(result, tmp_path):
    path = tmp_path / "result.json"
    ss.save(result, path)
    again = ss.load(path)
    assert type(again) is type(result) and state(again) == state(result)
    assert json.loads(path.read_text())["format"] == "semismooth"
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]


def test_every_class_that_can_be_saved_was_tried():
    tried = {type(r).__name__ for r in RESULTS}
    assert set(_core._saved_classes()) - tried <= {"BranchPoint", "CharacterChange"}


def test_what_was_restored_works():
    branch, diagram, traced = (pickle.loads(pickle.dumps(r)) for r in (RESULTS[9], RESULTS[10], RESULTS[12]))
    assert [t.kind for t in branch.transitions] == ["fold", "fold"] and branch.transitions[0].after[0] == "softening: first"
    assert branch.names == ["y", "load"]
    np.testing.assert_allclose(np.sort(diagram.solutions_at(0.25)[:, 0]), [-0.5, 0.0, 0.5], atol=1e-12)
    assert traced([2.0, 0.5]) == pytest.approx(0.25) and traced.num_sites == 2
    again = ss.follow(traced, branch.points[0], parameter_range=(0.0, 2.0))
    np.testing.assert_array_equal(again.points[-1], branch.points[-1])


def test_restored_batches_work():
    whole = ss.solve_mcp(lambda x, p: x - p, 0, [[1.0], [2.0]], 0.0, params=[[0.5], [np.nan]])
    again = pickle.loads(pickle.dumps(whole))
    assert again.messages == whole.messages and list(again.messages) == [1]
    with pytest.warns(UserWarning, match="1 member"):
        np.testing.assert_array_equal(again.jvp([1.0]), [[1.0], [np.nan]])
    state = _core._state(whole.sensitivity)
    with pytest.raises(ValueError, match="another batch"):
        _core._restored("BatchSensitivity", state | {"x": [0.0]})


def test_tables_of_what_was_restored_have_its_names():
    pytest.importorskip("pandas")
    assert pickle.loads(pickle.dumps(RESULTS[9])).to_pandas().columns[1] == "y"


def _solved(load):
    return ss.solve(lambda y: [y[0] - 1.25 * max(y[0] - 1, 0) - load], 0.0), ss.follow(beam, [0.0, 0.0], parameter_range=(0.0, load))


def test_restored_contact_problems_give_the_same_numbers():
    kinds = {type(r).__name__: r for r in RESULTS}
    solution = kinds["ContactSolution"]
    again = pickle.loads(pickle.dumps(solution))
    np.testing.assert_array_equal(again.displacements, solution.displacements)
    np.testing.assert_array_equal(again.stresses, solution.stresses)
    assert again.states == solution.states and again.energy == solution.energy
    anew = again.problem.solve(0.0)
    np.testing.assert_array_equal(anew.x, solution.x)
    step = kinds["EvolutionStep"]
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(step)).solution.slips, step.solution.slips)
    friction = ss.Friction.function(lambda slip, parameter: 0.4 * np.exp(-slip) + parameter)
    assert pickle.loads(pickle.dumps(friction))(0.3, 0.1) == friction(0.3, 0.1)


def test_functions_of_a_place_are_for_pickle_to_take():
    body = ss.Body(ss.Mesh.rectangle([0, 0], [1, 1], [1, 1]), ss.Material(1.0, 0.3), supports={"left": lambda p: 0.0})
    with pytest.raises((pickle.PicklingError, AttributeError)):
        pickle.dumps(body)
    assert copy.deepcopy(body).num_free == body.num_free


def test_other_processes_send_results():
    loads = [0.25, 0.5, 0.75]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.map(_solved, loads)
    assert [r.x[0] for r, _ in found] == pytest.approx(loads)
    assert [b.points[-1][1] for _, b in found] == pytest.approx(loads)


def test_damaged_files_are_refused(tmp_path):
    path = tmp_path / "file.json"
    ss.save(RESULTS[12], path)
    good = path.read_text()
    whole = json.loads(good)
    wrong = [
        "",
        "[1]",
        '{"format": "other"}',
        good[: len(good) // 2],
        json.dumps(whole | {"version": 99}),
        json.dumps(whole | {"content": {"class": "Nothing", "state": {}}}),
        json.dumps(whole | {"content": {"class": "Map", "state": {}}}),
        json.dumps(whole | {"content": {"array": [1], "type": "O", "shape": [1]}}),
        good.replace('"Variable"', '"Neg"'),
    ]
    for text in wrong:
        path.write_text(text)
        with pytest.raises(ValueError):
            ss.load(path)
    with pytest.raises(TypeError, match="cannot be saved"):
        ss.save(3.0, path)


def test_lists_and_branches_are_sequences():
    found = ss.all_solutions(lambda x: [abs(x[0]) + x[0] / 2 - 3])
    assert [s.x[0] for s in found] == found.points[:, 0].tolist()
    assert found[0].x == found.solutions[0].x and found[-1].x == found.solutions[-1].x
    with pytest.raises(IndexError):
        found[2]
    branch = RESULTS[9]
    np.testing.assert_array_equal(np.array(list(branch)), branch.points)


def test_reprs_are_short():
    assert ss.__version__.count(".") == 2
    found = ss.solve(lambda x: x - 2, 2.0)
    assert repr(found) == "<McpResult: solved, residual 0, 0 iterations>"
    for result in RESULTS:
        assert "0.0e0" not in repr(result) and " at 0x" not in repr(result)
    # Rounding of 0 beside other numbers is 0; small numbers that stand alone are not.
    rounded = ss.follow(lambda x: [x[0] - 0.1 - 0.2 - abs(x[1] + 0.1 + 0.2 - 0.3)], [0.4, -0.1], parameter_range=(-1.0, 1.0))
    assert repr(rounded.transitions[0]).endswith("at parameter 0.0>")
    tiny = {"x": np.array([1e-20, 2e-20]), "parameter": 2e-20, "kind": "kink", "arclength": None}
    assert repr(_core._restored("Fold", tiny)) == "<Fold: kink at parameter 2e-20>"


def test_notebooks_show_pictures_and_tables():
    pytest.importorskip("matplotlib")
    branch, diagram, listed = (RESULTS[k]._repr_html_() for k in (9, 10, 8))
    for text in (branch, diagram):
        assert text.startswith("<div") and "><svg" in text and "</svg>" in text
    assert "<td>fold</td><td>1</td><td>1</td>" in branch and "<th>load</th>" in branch
    assert "softening" in branch
    assert "<table>" in listed and "searched" not in listed and "there may be others" in listed


def test_names_are_in_tables_legends_and_pieces():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    branch = RESULTS[9]
    assert branch.pieces[0] == ["softening: second", "stop: second"]
    ax = branch.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("load", "y")
    labels = ax.get_legend_handles_labels()[1]
    assert "softening: 0, stop: 0" in labels and "softening: y − 1, stop: 0" in labels
    unnamed = ss.follow(lambda x: [x[0] + np.maximum(x[0] - 1, 0) - x[1]], [0.0, 0.0], parameter_range=(0.0, 3.0))
    assert unnamed.pieces[0] == ["second"]
    assert {"0", "x[0] − 1"} <= set(unnamed.plot().get_legend_handles_labels()[1])
    pyplot.close("all")
    with pytest.raises(ValueError, match="names"):
        ss.follow(beam, [0.0, 0.0], names=["y"])


def test_elements_of_named_kinks_are_numbered():
    traced = ss.trace(lambda x: ss.maximum(x, 0, name="stop"), 2)
    assert traced.pieces([1.0, -1.0]) == ["stop[0]: first", "stop[1]: second"]
    clipped = ss.trace(lambda x: [ss.clip(x[0], -1, 1, name="servo")], 1)
    assert clipped.pieces([5.0]) == ["servo: upper"]
