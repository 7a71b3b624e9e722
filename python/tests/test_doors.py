"""One function for each job, with plain functions and short arguments."""

import numpy as np
import pytest
import semismooth as ss


def beam(x):
    y, load = x
    return [y - 1.25 * max(y - 1, 0) + 10 * max(y - 3, 0) - load]


@pytest.mark.parametrize("start", [-50.0, 0.0, 3.0, 1e6])
def test_solve_finds_the_root_of_a_kinked_equation(start):
    found = ss.solve(lambda x: np.maximum(x, 2 * x) + np.minimum(x - 1, 0) - 3, start)
    assert found.solved and found.status == "solved" and found.x == pytest.approx([1.5], rel=1e-12)


def test_solve_takes_what_the_other_functions_take():
    matrix, q = [[2.0, 1.0], [1.0, 3.0]], [-3.0, -4.0]
    by_matrix = ss.solve((matrix, q), [0.0, 0.0])
    called = ss.solve(lambda x: np.matmul(matrix, x) + q, [0.0, 0.0], jac=lambda x: np.array(matrix))
    differences = ss.solve(lambda x: np.matmul(matrix, x) + q, [0.0, 0.0], jac="differences")
    for found in (by_matrix, called, differences):
        assert found.solved
        np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-8)


def test_black_boxes_with_kinks_are_solved():
    def blackbox(x):
        return np.array([x[0] + (2 * x[0] if x[0] > 1 else 2.0) - 7, abs(x[1]) + 3 * x[1] + x[0]])

    def slopes(x):
        return np.array([[3.0 if x[0] > 1 else 1.0, 0.0], [1.0, (1.0 if x[1] > 0 else -1.0) + 3.0]])

    found = ss.solve(blackbox, [0.0, 0.0], jac=slopes)
    assert found.solved and found.x == pytest.approx([7 / 3, -7 / 6])


def test_solve_does_not_claim_what_it_has_not_found():
    nothing = ss.solve(lambda x: np.abs(x) + 1, 3.0)
    assert not nothing.solved and nothing.status != "solved" and nothing.residual >= 1.0


def test_all_solutions_takes_a_function():
    affine = ss.all_solutions(lambda x: [abs(x[0]) + x[0] / 2 - 3])
    assert affine.complete and sorted(affine.points[:, 0]) == [-6.0, 2.0]
    two = ss.all_solutions(lambda x: [max(x[0], x[1]) - 1, x[0] + 2 * x[1]])
    assert two.complete and sorted(two.points[:, 0].round(12)) == [-2.0, 1.0]
    curve = ss.all_solutions(beam, 0.75)
    assert curve.complete and sorted(curve.points[:, 0].round(12)) == [0.75, 2.0, 3.025641025641]
    assert ss.all_solutions(lambda x: np.abs(x) - 1, num_vars=2).points.shape == (4, 2)


def test_curved_equations_are_searched():
    # x² = 2 |x| − 1/2 has four solutions, ±1 ± 1/√2.
    found = ss.all_solutions(lambda x: [x[0] ** 2 - 2 * abs(x[0]) + 0.5])
    assert (found.status, found.complete) == ("searched", False)
    expected = np.sort([s + t / np.sqrt(2) for s in (-1, 1) for t in (-1, 1)])
    np.testing.assert_allclose(np.sort(found.points[:, 0]), expected, atol=1e-9)
    assert all(s.residual < 1e-9 and s.margin > 0 and len(s.pieces) == 1 for s in found.solutions)
    from_starts = ss.all_solutions(lambda x: np.sin(x) - 0.5, starts=[[0.4], [2.5]])
    assert {0.523599, 2.617994} <= set(from_starts.points[:, 0].round(6))


def test_one_start_needs_no_list():
    one = ss.diagram(beam, [0.0, 0.0], parameter_range=(0.0, 2.0))
    listed = ss.diagram(beam, [[0.0, 0.0]], parameter_range=(0.0, 2.0))
    assert sorted(f.parameter for f in one.folds) == sorted(f.parameter for f in listed.folds) == [0.5, 1.0]


def test_numbers_and_none_are_starts_and_bounds():
    plain = ss.solve_mcp(lambda x: x - 2, None, None, 0.0)
    assert plain.solved and plain.x == pytest.approx([2.0])
    bounded = ss.solve_mcp(lambda x: x - 2, None, 1.0, 0.0)
    assert bounded.solved and bounded.x == pytest.approx([1.0]) and bounded.states == ["upper"]
    assert ss.solve_vi(lambda x: x - 2, 0.0, upper=1.0).x == pytest.approx([1.0])
    assert ss.solve_lcp([[2.0]], [-1.0], x0=0.0).x == pytest.approx([0.5])


@pytest.mark.parametrize("name", ["fischer burmeister", "Fischer-Burmeister", "FischerBurmeister"])
def test_strategies_are_named_in_words(name):
    alone, listed = (ss.solve_lcp([[2.0, 1.0], [1.0, 2.0]], [-5.0, -1.0], strategies=s) for s in (name, [name]))
    assert alone.solved and listed.solved and alone.strategy == listed.strategy
    again = ss.solve_lcp([[2.0]], [-1.0], strategies=alone.strategy)
    assert again.strategy == alone.strategy


def test_diagrams_find_their_starts():
    found = ss.diagram(beam, parameter_range=(0.0, 2.0))
    assert sorted(f.parameter for f in found.folds) == pytest.approx([0.5, 1.0])
    # A closed curve at |y| + |a| = 1 and a line, met at a = 1/2 alone.
    island = ss.diagram(lambda x: [min(abs(x[0]) + abs(x[1]) - 1, x[0] + 3)], parameter_range=(-2.0, 2.0), sections=[0.5])
    assert len(island.isolas) == 1 and len(island.branches) == 2
    curved = ss.diagram(lambda x: [x[0] ** 2 - x[1]], parameter_range=(-1.0, 1.0))
    assert [f.kind for f in curved.folds] == ["smooth"]
    with pytest.raises(ValueError, match="starts"):
        ss.diagram(beam)
    with pytest.raises(ValueError, match="no solution"):
        ss.diagram(lambda x: [x[0] ** 2 + x[1] ** 2 + 1], parameter_range=(0.0, 1.0))


def test_jumps_are_reported_where_a_run_fails():
    jumping = ss.solve(lambda x: np.where(x > 1, x + 1, x - 2), 3.0)
    assert not jumping.solved and "the function jumps at site 0" in jumping.message
    kinked = ss.solve(lambda x: np.where(x > 1, x + 1, 2 * x), -3.0)
    assert kinked.solved and "jumps" not in kinked.message
    undefined = ss.solve(lambda x: [max(x[0], 2 * x[0]) - 3, x[1] * float("nan")], [0.0, 0.0])
    assert "cannot be evaluated" in undefined.message and "jumps" not in undefined.message
    nowhere = ss.solve(lambda x: np.abs(x) + 1, 3.0)
    assert not nowhere.solved and "jumps" not in nowhere.message
    traced = ss.trace(lambda x: [np.where(x[0] > 1, x[0] + 1, 2 * x[0])], 1)
    assert traced.check([[0.3], [1.9], [-2.0]]) == []
    with pytest.raises(ss.SemismoothError):
        traced.check([])


def test_runs_tell_what_they_do(capsys):
    seen = []
    ss.solve(lambda x: x**2 - 2, 1.0, verbose=True, callback=lambda now: seen.append(now))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(seen) and all("residual" in line for line in lines)
    branch = ss.follow(lambda x: [abs(x[0]) - x[1]], [1.0, 1.0], (-1.0, 2.0), "decreasing", verbose=True, progress=True)
    out, error = capsys.readouterr()
    assert len(out.splitlines()) == len(branch) and "fold" in out
    # The bar is on the other stream, with tqdm or without.
    assert str(len(branch)) in error
    # A callback ends the run as before.
    stopped = ss.follow(lambda x: [x[0] - x[1] ** 3], [0.0, 0.0], (0.0, 9.0), callback=lambda now: True, verbose=True)
    assert stopped.termination == "interrupted"
