"""Functions that Python calls, with kinks that nobody told of."""

import multiprocessing
import pickle

import numpy as np
import pytest

import semismooth as ss


def beam(x):
    # As it might come from another program: with branches, which cannot be traced.
    y, load = float(x[0]), float(x[1])
    force = y
    if y > 1:
        force -= 1.25 * (y - 1)
    if y > 3:
        force += 10 * (y - 3)
    return [force - load]


def slope(x):
    return [[1 - 1.25 * (x[0] > 1) + 10 * (x[0] > 3), -1.0]]


@pytest.mark.parametrize(("jac", "accuracy"), [(slope, 1e-11), ("differences", 1e-8)])
def test_corners_are_found_where_kinks_are_not_known(jac, accuracy):
    branch = ss.follow(beam, [0.0, 0.0], (0.0, 2.0), jac=jac, monitors={"two": lambda x: x[0] - 2})
    assert not branch.pieces_known and "pieces not known" in repr(branch)
    np.testing.assert_allclose([f.x for f in branch.folds], [[1.0, 1.0], [3.0, 0.5]], atol=accuracy)
    assert {f.kind for f in branch.folds} == {"not known"}
    assert branch.termination == "bound of the parameter"
    np.testing.assert_allclose(branch.points[-1], [30.75 / 9.75, 2.0], atol=1e-9)
    np.testing.assert_allclose([c.x for c in branch.crossings], [[2.0, 0.75]], atol=1e-9)
    assert max(abs(beam(x)[0]) for x in branch.points) < 1e-9
    # Far fewer points than a curve that is bent to rounding would take.
    assert len(branch) < 60
    assert branch.events.count("turning point") == 2
    assert "complete" not in repr(branch) + branch._repr_html_()
    assert repr(pickle.loads(pickle.dumps(branch))) == repr(branch)


def test_a_promise_that_there_are_no_kinks_gives_smooth_folds():
    def circle(x):
        return [x[0] ** 2 + x[1] ** 2 - 1]

    def derivative(x):
        return [[2 * x[0], 2 * x[1]]]

    smooth = ss.follow(circle, [1.0, 0.0], jac=derivative, smooth=True)
    unknown = ss.follow(circle, [1.0, 0.0], jac=derivative)
    assert smooth.pieces_known and [f.kind for f in smooth.folds] == ["smooth", "smooth"]
    assert smooth.termination == unknown.termination == "closed curve"
    np.testing.assert_allclose([f.x for f in unknown.folds], [f.x for f in smooth.folds], atol=1e-8)
    with pytest.raises(ValueError, match="jac"):
        ss.follow(circle, [1.0, 0.0], smooth=True)


def test_black_boxes_are_solved():
    def kinked(x):
        return [abs(float(x[0])) - 0.5 * x[0] - 1]

    result = ss.solve(kinked, [3.0], jac=lambda x: [[np.sign(x[0]) - 0.5]])
    assert result.solved
    np.testing.assert_allclose(result.x, [2.0], atol=1e-12)


def test_patterns_that_change_are_named():
    sparse = pytest.importorskip("scipy.sparse")

    def jac(x):
        return sparse.csr_matrix([[2.0 * x[0], 1.0 if x[0] > 0.5 else 0.0], [0.0, 1.0]])

    with pytest.raises(ValueError, match="pattern="):
        ss.solve(lambda x: [x[0] ** 2 - 1 + max(x[1], 0) * 0, x[1]], [0.4, 1.0], jac=jac)


def fails(_):
    ss.solve_lcp([[1.0, 2.0]], [1.0])


def test_exceptions_come_out_of_other_processes():
    assert ss.SemismoothError.__module__ == "semismooth"
    error = pickle.loads(pickle.dumps(ss.SemismoothError("as it was")))
    assert isinstance(error, ss.SemismoothError) and str(error) == "as it was"
    with multiprocessing.get_context("spawn").Pool(1) as pool, pytest.raises(ValueError):
        pool.map(fails, [0])
