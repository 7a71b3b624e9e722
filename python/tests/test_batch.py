"""Many problems at once: the same results as one by one, failures marked, shapes checked."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import semismooth as ss


def lcps(members, n, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(members, n, n))
    M = A @ A.transpose(0, 2, 1) / n + 0.1 * np.eye(n) + 0.3 * (A - A.transpose(0, 2, 1))
    return M, rng.normal(size=(members, n))


def test_lcps_are_solved_as_one_by_one():
    M, q = lcps(50, 6)
    found = ss.solve_lcp(M, q)
    assert found.x.shape == (50, 6) and found.solved.all() and set(found.status) == {"solved"} and len(found) == 50
    for i in range(50):
        z = found.x[i]
        w = M[i] @ z + q[i]
        assert np.abs(np.minimum(z, w)).max() < 1e-9
        np.testing.assert_array_equal(z, ss.solve_lcp(M[i], q[i]).x)
    shared = ss.solve_lcp(M[0], q, upper=0.5)
    assert shared.solved.all() and (shared.x <= 0.5).all()
    np.testing.assert_array_equal(shared.x[7], ss.solve_lcp(M[0], q[7], upper=0.5).x)
    starts = ss.solve_lcp(M[0], q[0], x0=np.ones((3, 6)))
    np.testing.assert_allclose(starts.x, np.tile(found.x[0], (3, 1)), atol=1e-9)
    assert ss.solve_lcp(M[:0], q[:0]).x.shape == (0, 6)
    # Nothing is asked of members without unknowns.
    empty = ss.solve_lcp(np.zeros((3, 0, 0)), np.zeros((3, 0)))
    assert empty.solved.all() and empty.x.shape == (3, 0) and repr(empty) == "<BatchResult: 3 of 3 solved>"
    empty = ss.solve_mcp(lambda x: x, np.zeros(0), np.ones(0), np.zeros((3, 0)))
    assert empty.solved.all() and empty.x.shape == (3, 0) and repr(empty) == "<BatchResult: 3 of 3 solved>"
    empty = ss.solve_mcp(lambda x, p: x, np.zeros(0), np.ones(0), np.zeros((3, 0)), params=np.ones((3, 2)))
    assert empty.solved.all() and empty.derivative().shape == (3, 0, 2) and empty.jvp(np.ones((3, 2))).shape == (3, 0)
    assert (empty.vjp(np.zeros((3, 0))) == np.zeros((3, 2))).all() and empty.differentiable == [True] * 3
    empty = ss.solve_friction(np.zeros((3, 0, 0)), np.zeros((3, 0)), np.zeros((3, 0)))
    assert empty.solved.all() and empty.reactions.shape[:2] == (3, 0) and (empty.residual == 0).all()


def test_failures_are_marked_one_by_one():
    M, q = lcps(5, 3)
    q[1, 2] = np.nan
    M[3], q[3] = -np.eye(3), [-1.0, 1.0, 1.0]
    found = ss.solve_lcp(M, q)
    assert found.solved.tolist() == [True, False, True, False, True]
    assert found.status[1] == "invalid" and found.status[3] == "no solution"
    assert set(found.messages) == {1, 3} and "q" in found.messages[1]
    assert np.isnan(found.x[1]).all() and np.isfinite(found.x[[0, 2, 3, 4]]).all()


@pytest.mark.parametrize(
    ("arguments", "options", "match"),
    [
        ((np.zeros((4, 3, 3)), np.zeros((5, 3))), {}, "4 members and q 5"),
        ((np.zeros((4, 3, 2)), np.zeros((4, 3))), {}, r"M has the shape \(4, 3, 2\), expected \(3, 3\)"),
        ((np.zeros((2, 2, 3, 3)), np.zeros(3)), {}, "M has the shape"),
        ((np.eye(3), np.zeros((4, 3))), {"x0": np.zeros((3, 3))}, "x0 3"),
        ((np.eye(3), np.zeros((4, 3))), {"lower": np.zeros((4, 2))}, "lower has the shape"),
        ((np.eye(3), [["a", "b", "c"]]), {}, "q must be an array of numbers"),
        ((np.eye(3), np.zeros((4, 3), dtype=complex)), {}, "complex"),
        ((np.eye(3), np.zeros((4, 3))), {"callback": print}, "callback"),
    ],
)
def test_shapes_are_checked(arguments, options, match):
    with pytest.raises((ValueError, TypeError), match=match):
        ss.solve_lcp(*arguments, **options)


def demand(x, p):
    return [np.exp(x[0]) - p[0] + 0.3 * x[1], x[1] + p[1] * x[0] - p[0]]


def test_mcps_trace_their_function_once():
    calls = []

    def counted(x, p):
        calls.append(1)
        return demand(x, p)

    p = np.stack([np.linspace(0.5, 3.0, 40), np.linspace(-1.0, 1.0, 40)], axis=1)
    found = ss.solve_mcp(counted, 0, [np.inf, 2.0], np.ones(2), params=p)
    assert len(calls) == 1 and found.solved.all()
    ones = [ss.solve_mcp(demand, 0, [np.inf, 2.0], np.ones(2), params=row) for row in p]
    np.testing.assert_allclose(found.x, [one.x for one in ones], atol=1e-9)
    assert found.differentiable == [one.differentiable for one in ones]
    np.testing.assert_allclose(found.derivative(), [one.derivative() for one in ones], atol=1e-8)
    dp, dx = np.array([0.3, -1.0]), np.random.default_rng(1).normal(size=(40, 2))
    np.testing.assert_allclose(found.jvp(dp), [one.jvp(dp) for one in ones], atol=1e-8)
    np.testing.assert_allclose(found.vjp(dx), [one.vjp(w) for one, w in zip(ones, dx)], atol=1e-8)


def test_each_member_has_its_own_bounds_and_start():
    lower = np.array([[0.0], [1.0], [-np.inf]])
    found = ss.solve_mcp(lambda x, p: x - p, lower, np.inf, [[0.0], [3.0], [-2.0]], params=[[-1.0], [0.5], [-4.0]])
    np.testing.assert_allclose(found.x, [[0.0], [1.0], [-4.0]])
    np.testing.assert_allclose(found.derivative(), [[[0.0]], [[0.0]], [[1.0]]], atol=1e-14)
    starts = ss.solve_mcp(lambda x: x**2 - 1, -np.inf, np.inf, [[2.0], [-2.0]])
    np.testing.assert_allclose(starts.x, [[1.0], [-1.0]], atol=1e-8)
    assert starts.sensitivity is None
    with pytest.raises(ValueError, match="params"):
        starts.jvp(1.0)


def test_members_without_a_derivative_are_named():
    found = ss.solve_mcp(lambda x, p: x**2 + p, -np.inf, np.inf, [1.0], params=[[-1.0], [1.0], [np.nan], [-4.0]])
    assert found.solved.tolist() == [True, False, False, True]
    assert found.status[2] == "invalid" and "params[0]" in found.messages[2]
    with pytest.warns(UserWarning, match=r"2 members without a derivative have NaN in their rows \(1, 2\)"):
        rates = found.jvp([1.0])
    np.testing.assert_allclose(rates[[0, 3], 0], [-0.5, -0.25])
    assert np.isnan(rates[1:3]).all() and found.differentiable == [True, None, None, True]


def test_sensitivities_of_a_batch():
    x = np.array([[3.0], [2.0], [2.0]])
    p = np.array([[3.0, 1.0], [2.0, 1.0], [1.0, 1.0]])
    found = ss.sensitivity(lambda x, p: x - np.maximum(p[0], 2 * p[1]), x, p)
    assert found.differentiable == [True, False, True] and len(found) == 3
    np.testing.assert_allclose(found.jvp([0.0, 1.0]), [[0.0], [2.0], [2.0]])
    np.testing.assert_allclose(found.jvp([0.0, -1.0]), [[0.0], [0.0], [-2.0]])
    np.testing.assert_allclose(found.vjp([[1.0], [1.0], [2.0]])[[0, 2]], [[1.0, 0.0], [0.0, 4.0]])
    with pytest.warns(UserWarning, match="1 member without a derivative"):
        assert np.isnan(found.derivative()[1]).all()
    with pytest.raises(ValueError, match="dp has 2 members for a batch of 3"):
        found.jvp(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="gives 2"):
        ss.sensitivity(lambda x, p: [x[0], p[0]], x, p)
    with pytest.raises(ValueError, match="3 members and params 2"):
        ss.sensitivity(lambda x, p: x - p[0], x, p[:2])


def test_friction_problems():
    mu = np.array([[0.3], [0.1], [0.3], [np.nan]])
    q = np.array([-1.0, -0.2])
    found = ss.solve_friction(np.eye(2), q, mu)
    assert found.reactions.shape == (4, 1, 2) and found.solved.tolist() == [True, True, True, False]
    np.testing.assert_allclose(found.reactions[:3, 0], [[1.0, 0.2], [1.0, 0.1], [1.0, 0.2]], atol=1e-9)
    np.testing.assert_allclose(found.velocities[1, 0], [0.0, -0.1], atol=1e-9)
    assert found.status[3] == "invalid" and list(found.messages) == [3]
    with pytest.raises(ValueError, match="no multiple"):
        ss.solve_friction(np.eye(3), np.zeros((2, 3)), [0.1, 0.2])


def test_results_do_not_depend_on_the_number_of_threads():
    script = """
import sys
sys.path.insert(0, {folder!r})
from test_batch import lcps
import semismooth as ss
M, q = lcps(200, 8)
sys.stdout.write(ss.solve_lcp(M, q).x.tobytes().hex())
"""
    runs = []
    for threads in ["1", "2", "3"]:
        environment = {**os.environ, "SEMISMOOTH_NUM_THREADS": threads}
        code = script.format(folder=os.path.dirname(__file__))
        run = subprocess.run([sys.executable, "-B", "-c", code], env=environment, capture_output=True, text=True, check=True)
        runs.append(run.stdout)
    assert runs[0] == runs[1] == runs[2] and len(runs[0]) == 2 * 8 * 8 * 200


def test_the_recipe_for_torch():
    """The class in the README."""
    torch = pytest.importorskip("torch")
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    recipe = next(block for block in readme.split("```python")[1:] if "torch.autograd.Function" in block).split("```")[0]
    names = {"torch": torch, "ss": ss, "F": demand, "lower": 0, "upper": np.inf, "x0": np.ones(2)}
    exec(recipe, names)
    solution = names["Solution"].apply
    p = torch.tensor([[3.0, 0.7], [2.0, 0.1]], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(solution, (p,), eps=1e-6, atol=1e-6)
    with pytest.raises(ss.SemismoothError, match="not solved"):
        solution(torch.tensor([[float("nan"), 0.7]]))
