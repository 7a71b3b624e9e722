"""Derivatives of solutions in parameters."""

import numpy as np
import pytest
import semismooth as ss


def prices(x, p):
    return [np.exp(x[0]) - p[0] + 0.3 * x[1], x[1] + p[1] * x[0] - p[0], x[2] + 1 + p[1]]


def test_derivatives_are_those_of_differences():
    p = np.array([3.0, 0.7])
    result = ss.solve_mcp(prices, 0, np.inf, np.ones(3), params=p)
    assert result.solved and result.differentiable is True
    step = 1e-5
    columns = []
    for j in range(2):
        ends = [ss.solve_mcp(prices, 0, np.inf, np.ones(3), params=p + s * np.eye(2)[j]).x for s in (step, -step)]
        columns.append((ends[0] - ends[1]) / (2 * step))
    np.testing.assert_allclose(result.derivative(), np.array(columns).T, atol=1e-7)
    dp, dx = np.array([0.3, -1.0]), np.array([1.0, 2.0, -0.5])
    assert dx @ result.jvp(dp) == pytest.approx(result.vjp(dx) @ dp, abs=1e-14)
    assert result.sensitivity.message == "differentiable"


def test_at_a_kink_derivatives_are_one_sided():
    result = ss.solve_mcp(lambda x, p: x - p, 0.0, np.inf, 1.0, params=0.0)
    assert result.differentiable is False
    assert result.jvp(1.0) == pytest.approx([1.0]) and result.jvp(-1.0) == pytest.approx([0.0])
    assert result.vjp(1.0) in ([0.0], [1.0])
    with pytest.raises(ss.SemismoothError, match="not known to be differentiable"):
        result.derivative()
    kinked = ss.solve(lambda x, p: x + np.maximum(x, 0) - p[0] - p[1] ** 2, 0.5, params=[0.0, 0.0])
    assert kinked.differentiable is False
    assert kinked.jvp([1.0, 5.0]) == pytest.approx([0.5]) and kinked.jvp([-1.0, 5.0]) == pytest.approx([-1.0])


def test_folds_have_branches_and_no_derivative():
    fold = ss.sensitivity(lambda x, p: abs(x) - p, 0.0, 0.0)
    assert fold.differentiable is None and "not known to be one function" in fold.message
    ahead, complete = fold.branches(1.0)
    assert sorted(ahead[:, 0]) == [-1.0, 1.0] and complete
    assert fold.branches(-1.0)[0].shape == (0, 1)
    with pytest.raises(ss.SemismoothError, match="branches|one function"):
        fold.jvp(1.0)


def test_elements_belong_to_the_side_that_the_frame_enters():
    kink = ss.sensitivity(lambda x, p: x - np.maximum(p[0], 2 * p[1]), 0.0, [0.0, 0.0])
    assert kink.element().tolist() == [[1.0, 0.0]]
    assert kink.element([[0.0, 1.0], [1.0, 0.0]]).tolist() == [[0.0, 2.0]]
    with pytest.raises(ss.SemismoothError, match="linearly independent"):
        kink.element([[1.0, 1.0], [2.0, 2.0]])


def test_the_range_is_that_of_the_piece():
    result = ss.solve_mcp(lambda x, p: 2 * x - p, 0.0, 3.0, 1.0, params=2.0)
    assert result.valid_until(1.0) == pytest.approx(4.0) and result.valid_until(-1.0) == pytest.approx(2.0)
    curved = ss.sensitivity(lambda x, p: x - np.maximum(np.exp(p) - 2, 0), 0.0, 0.0)
    assert curved.valid_until(1.0, horizon=5.0) == pytest.approx(np.log(2))
    assert curved.valid_until(-1.0, horizon=5.0) == 5.0


def test_fixed_and_one_sided_bounds_are_those_of_the_problem():
    lower, upper = [1.0, -np.inf, -np.inf, 0.0], [1.0, 2.0, np.inf, 1.0]
    result = ss.solve_mcp(lambda x, p: [x[0] - p[0], x[1] - p[0], x[2] - p[0], x[3] - p[1]], lower, upper, np.ones(4), params=[5.0, 0.5])
    np.testing.assert_allclose(result.x, [1.0, 2.0, 5.0, 0.5])
    np.testing.assert_allclose(result.derivative(), [[0, 0], [0, 0], [1, 0], [0, 1]], atol=1e-15)


def test_bad_input_is_told():
    with pytest.raises(ss.SemismoothError, match="no solution"):
        ss.sensitivity(lambda x, p: x - p, 3.0, 1.0)
    with pytest.raises(ss.SemismoothError, match="does not enter"):
        ss.sensitivity(lambda x, p: x - p[0], 3.0, [3.0, 1.0])
    with pytest.raises(ss.SemismoothError, match="irregular"):
        ss.sensitivity(lambda x, p: x**3 - p, 0.0, 0.0)
    with pytest.raises(ValueError, match="gives 2"):
        ss.sensitivity(lambda x, p: [x[0], p[0]], 0.0, 0.0)
    with pytest.raises(TypeError, match="jac"):
        ss.solve(lambda x, p: x - p, 0.0, jac="differences", params=1.0)
    plain = ss.solve(lambda x: x - 1, 0.0)
    assert plain.sensitivity is None
    with pytest.raises(ValueError, match="params"):
        plain.jvp(1.0)
    result = ss.solve(lambda x, p: x - p, 0.0, params=1.0)
    with pytest.raises(ss.SemismoothError, match="length"):
        result.jvp([1.0, 2.0])


def test_contact_forces_have_derivatives_in_the_load():
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [8, 4])
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={"left": [0.0, 0.0]})
    problem = ss.ContactProblem(
        body, "bottom", ss.Foundation.plane([0, 0], [0, 1]), 0.3, load=body.traction("top", [0.0, -0.02]), rate=body.traction("top", [0.02, 0.0])
    )
    solution = problem.solve(0.5)
    assert solution.differentiable is True
    rate, until = solution.jvp(), solution.valid_until()
    assert rate[-1] == 1.0 and until > 0
    step = 0.5 * min(until, solution.valid_until(-1.0), 1.0)
    # Forces are affine functions of the load as long as no node changes its state.
    np.testing.assert_allclose(problem.solve(0.5 + step).x, solution.x + step * rate, atol=1e-10)
    np.testing.assert_allclose(problem.solve(0.5 - step).x, solution.x + step * solution.jvp(-1.0), atol=1e-10)
    dx = np.arange(1.0, len(rate))
    assert solution.vjp(dx) == pytest.approx([dx @ rate[:-1]], rel=1e-10)
    kink = ss.follow(problem, solution, parameter_range=(0.5, 2.0)).transitions[0]
    at = problem.at(kink.x)
    assert at.differentiable is False
    assert not np.allclose(at.jvp(), -at.jvp(-1.0))


def test_parameters_that_are_not_finite_are_named():
    with pytest.raises(ValueError, match=r"params\[1\] is NaN"):
        ss.solve(lambda x, p: [x[0] - p[0] - p[1]], [0.0], params=[1.0, np.nan])
