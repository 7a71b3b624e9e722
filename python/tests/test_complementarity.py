"""Complementarity problems against enumeration of all bases, scipy and quantecon."""

import itertools
import os
import signal
import threading
import time

import numpy as np
import pytest
import scipy.optimize
import scipy.sparse
import semismooth as ss


def by_all_bases(M, q):
    """Every solution of a nondegenerate LCP: one linear system for each of the 2ⁿ complementary bases."""
    found = []
    n = len(q)
    for basis in itertools.product([False, True], repeat=n):
        free = np.flatnonzero(basis)
        z = np.zeros(n)
        if free.size:
            z[free] = np.linalg.solve(M[np.ix_(free, free)], -q[free])
        w = M @ z + q
        w[free] = 0.0
        if (z >= 0).all() and (w >= 0).all():
            found.append(z)
    return np.array(found)


def in_order(points):
    return points[np.lexsort(points.T)] if len(points) else points


@pytest.mark.parametrize("seed", range(30))
def test_lists_of_random_lcps_are_those_of_all_bases(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    M, q = rng.normal(size=(n, n)), rng.normal(size=n)
    expected = by_all_bases(M, q)
    found = ss.all_solutions(ss.Lcp(M, q))
    assert found.complete and found.completeness == "complete"
    assert len(found) == len(expected)
    if len(expected):
        np.testing.assert_allclose(in_order(found.points), in_order(expected), rtol=1e-9, atol=1e-12)
    for solution in found.solutions:
        nearest = expected[np.abs(expected - solution.x).max(axis=1).argmin()]
        assert solution.pieces == [["interior" if z > 0 else "lower" for z in nearest]]


@pytest.mark.parametrize("seed", range(30))
def test_what_is_called_solved_is_in_the_list_and_infeasible_ones_have_none(seed):
    rng = np.random.default_rng(100 + seed)
    n = int(rng.integers(1, 8))
    M, q = rng.normal(size=(n, n)), rng.normal(size=n)
    expected = by_all_bases(M, q)
    for result in (ss.solve_lcp(M, q), ss.lemke(M, q)):
        assert result.solved == (result.status == "solved")
        if result.solved:
            assert np.abs(expected - result.x).max(axis=1).min() < 1e-8
        elif result.status == "no solution":
            assert len(expected) == 0
    # At most 24 components: the last resort of solve_lcp decides.
    assert ss.solve_lcp(M, q).solved == (len(expected) > 0)


def test_proofs_that_there_is_no_solution_hold():
    M, q = np.array([[1.0, 2.0], [-2.0, -1.0]]), np.array([1.0, -1.0])
    result = ss.lemke(M, q)
    assert result.status == "no solution"
    v = result.ray
    assert (v >= 0).all() and (M.T @ v <= 0).all() and q @ v < 0


@pytest.mark.parametrize("seed", range(5))
def test_lemke_agrees_with_quantecon(seed):
    quantecon = pytest.importorskip("quantecon")
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(12, 12))
    M, q = root @ root.T + 0.1 * np.eye(12), rng.normal(size=12)
    other = quantecon.optimize.lcp_lemke(M, q)
    assert other.success
    np.testing.assert_allclose(ss.lemke(M, q).x, other.z, atol=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_least_squares_with_signs_agree_with_nnls(seed):
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(30, 12)), rng.normal(size=30)
    expected, _ = scipy.optimize.nnls(A, b)
    result = ss.solve_lcp(A.T @ A, -A.T @ b)
    assert result.solved
    np.testing.assert_allclose(result.x, expected, atol=1e-10)
    assert [s == "interior" for s in result.states] == list(expected > 0)


def test_bounds_are_those_of_bounded_least_squares():
    rng = np.random.default_rng(3)
    A, b = rng.normal(size=(20, 8)), 3 * rng.normal(size=20)
    expected = scipy.optimize.lsq_linear(A, b, bounds=(-0.2, 0.3), tol=1e-14).x
    result = ss.solve_lcp(A.T @ A, -A.T @ b, lower=-0.2, upper=np.full(8, 0.3))
    assert result.solved
    np.testing.assert_allclose(result.x, expected, atol=1e-7)
    assert {"lower", "upper", "interior"} == set(result.states)


def obstacle(n):
    """A string over an obstacle, n inner points: M u + q ≥ 0 ⟂ u ≥ 0."""
    M = scipy.sparse.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    q = np.where(np.arange(n) < n // 3, 1.0, -0.5) / n**2
    return M, q


@pytest.mark.parametrize("form", ["csr", "csc", "coo"])
def test_sparse_matrices_give_what_dense_ones_do(form):
    M, q = obstacle(60)
    dense = ss.solve_lcp(M.toarray(), q)
    result = ss.solve_lcp(M.asformat(form), q)
    assert result.solved and dense.solved
    np.testing.assert_allclose(result.x, dense.x, atol=1e-12)


def test_duplicates_and_unsorted_indices_are_summed():
    data, indices, starts = np.array([1.0, 0.5, 1.5, 1.0]), np.array([1, 0, 0, 1]), np.array([0, 3, 4])
    M = scipy.sparse.csc_matrix((data, indices, starts), shape=(2, 2))
    result = ss.solve_lcp(M, [-4.0, -3.0])
    np.testing.assert_allclose(M.toarray() @ result.x, [4.0, 3.0])
    assert not M.has_canonical_format, "the matrix given was changed"


def bratu(x):
    n = len(x)
    left, right = np.concatenate([[0.0], x[:-1]]), np.concatenate([x[1:], [0.0]])
    return (n + 1) ** 2 * (2 * x - left - right) - np.exp(x)


def bratu_jacobian(x, form):
    n = len(x)
    main, off = 2 * (n + 1) ** 2 - np.exp(x), -((n + 1) ** 2) * np.ones(n - 1)
    return scipy.sparse.diags_array([off, main, off], offsets=[-1, 0, 1]).asformat(form)


def test_all_ways_to_a_jacobian_lead_to_the_root_of_scipy():
    n = 20
    root = scipy.optimize.root(bratu, np.zeros(n), tol=1e-13)
    assert root.success
    arguments = [-np.inf, np.inf, np.zeros(n)]
    dense, sparse = (lambda x: bratu_jacobian(x, "csr").toarray()), (lambda x: bratu_jacobian(x, "csr"))
    pattern = bratu_jacobian(np.zeros(n), "coo")
    for result in [
        ss.solve_mcp(bratu, *arguments),
        ss.solve_mcp(ss.trace(bratu, n), *arguments),
        ss.solve_mcp(bratu, *arguments, jac=dense),
        ss.solve_mcp(bratu, *arguments, jac=sparse),
        ss.solve_mcp(bratu, *arguments, jac="differences"),
        ss.solve_mcp(bratu, *arguments, jac="differences", pattern=pattern),
    ]:
        assert result.solved
        np.testing.assert_allclose(result.x, root.x, atol=1e-9)


def test_a_bounded_minimum_is_that_of_scipy():
    def gradient(x):
        a, b = x
        return [-2 * (1 - a) - 400 * a * (b - a * a), 200 * (b - a * a)]

    bounds = scipy.optimize.Bounds([-2.0, -2.0], [0.5, 2.0])
    rosenbrock = scipy.optimize.minimize(scipy.optimize.rosen, [0.0, 0.0], jac=scipy.optimize.rosen_der, bounds=bounds, tol=1e-14)
    result = ss.solve_mcp(gradient, [-2.0, -2.0], [0.5, 2.0], [0.0, 0.0])
    assert result.solved and result.states == ["upper", "interior"]
    np.testing.assert_allclose(result.x, rosenbrock.x, atol=1e-6)
    np.testing.assert_allclose(result.x, [0.5, 0.25], atol=1e-12)


def test_functions_with_kinks_of_their_own_are_solved():
    # x + |x − 1| − 3 = 0 has the solution 2; below 1 it is constant.
    result = ss.solve_mcp(lambda x: x + abs(x - 1) - 3, 0.0, 10.0, [0.2])
    assert result.solved
    assert result.x[0] == pytest.approx(2.0, abs=1e-12)


def test_after_tracing_no_python_runs():
    calls = []

    def function(x):
        calls.append(1)
        return bratu(x)

    assert ss.solve_mcp(function, -np.inf, np.inf, np.zeros(20)).solved
    assert len(calls) == 1


def test_history_and_callback_tell_the_same_iterates():
    seen = []
    result = ss.solve_mcp(bratu, -np.inf, np.inf, np.zeros(20), callback=seen.append)
    assert seen == result.history and len(seen) >= 3
    assert [h["index"] for h in seen] == list(range(len(seen)))
    assert seen[-1]["residual"] < seen[0]["residual"]


def test_a_callback_stops_the_run():
    seen = []
    result = ss.solve_mcp(bratu, -np.inf, np.inf, np.zeros(20), callback=lambda h: seen.append(h) or h["index"] == 1)
    assert result.status == "interrupted" and not result.solved
    assert [h["index"] for h in seen] == [0, 1]


@pytest.mark.parametrize("where", ["function", "jacobian", "callback"])
@pytest.mark.parametrize("after", [1, 4])
def test_exceptions_of_callbacks_come_out_unchanged_and_at_once(where, after):
    error, calls = ZeroDivisionError("mine"), {"function": 0, "jacobian": 0, "callback": 0}

    def counted(what, work):
        def call(x):
            calls[what] += 1
            if what == where and calls[what] >= after:
                raise error
            return work(x)

        return call

    with pytest.raises(ZeroDivisionError) as caught:
        ss.solve_mcp(
            counted("function", bratu),
            -np.inf,
            np.inf,
            np.zeros(20),
            jac=counted("jacobian", lambda x: bratu_jacobian(x, "csc")),
            callback=counted("callback", lambda h: None),
        )
    assert caught.value is error
    assert calls[where] == after


def test_ctrl_c_ends_a_run_without_callbacks():
    # Without the limits this problem without solution would take minutes.
    def function(x):
        return np.exp(x) + np.roll(x, 1) ** 2 + 1

    def interrupt():
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        ss.solve_mcp(
            function,
            -np.inf,
            np.inf,
            np.zeros(100),
            max_iterations=10**9,
            max_attempt=10**9,
            restarts=10**4,
        )


def test_the_lock_is_free_while_a_traced_problem_is_solved():
    ticks = []

    def count():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    done = threading.Event()
    thread = threading.Thread(target=count)
    rng = np.random.default_rng(0)
    root = rng.normal(size=(300, 300))
    M, q = root @ root.T / 300 + np.eye(300), rng.normal(size=300)
    thread.start()
    begun = time.perf_counter()
    assert ss.solve_lcp(M, q).solved
    ended = time.perf_counter()
    done.set()
    thread.join()
    assert any(begun < t < ended for t in ticks)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: ss.solve_lcp([[1.0]], [1.0, 2.0]), ss.SemismoothError, "2"),
        (lambda: ss.solve_lcp([[1.0, 2.0]], [1.0]), ss.SemismoothError, "square"),
        (lambda: ss.solve_lcp([[np.nan]], [1.0]), ss.SemismoothError, "must be finite"),
        (lambda: ss.solve_lcp([[1.0]], [np.inf]), ss.SemismoothError, "not finite"),
        (lambda: ss.solve_lcp([[1.0]], [1.0], 2.0, 1.0), ss.SemismoothError, "lies above"),
        (lambda: ss.solve_lcp([[1.0]], [1.0], tolerance=-1.0), ss.SemismoothError, "tolerance"),
        (lambda: ss.solve_lcp([[1.0]], [1.0], tol=1e-3), TypeError, "tolerance"),
        (lambda: ss.solve_lcp([[1.0]], [1.0], strategies=["None"]), TypeError, "Newton"),
        (lambda: ss.solve_lcp("M", [1.0]), TypeError, "M must be"),
        (lambda: ss.solve_lcp([[1.0]], [1.0], max_time=-1.0), ValueError, "max_time"),
        (lambda: ss.solve_mcp(lambda x: x[:1], 0, 1, [0.5, 0.5]), ValueError, "it gives 1 for 2"),
        (lambda: ss.solve_mcp(lambda x: x[:1], 0, 1, [0.5, 0.5], jac="differences"), ValueError, "returned 1 values"),
        (lambda: ss.solve_mcp(lambda x: x, 0, 1, [0.5], jac="3-point"), ValueError, "differences"),
        (lambda: ss.solve_mcp(lambda x: x, 0, 1, [0.5], jac=3), TypeError, "jac"),
        (lambda: ss.solve_mcp(lambda x: x, 0, 1, [0.5], jac=lambda x: [[1.0, 2.0]]), ValueError, "shape"),
        (lambda: ss.all_solutions(lambda x: x), ValueError, "num_vars"),
        (lambda: ss.all_solutions(3.0), TypeError, "function"),
        (lambda: ss.lemke([[1.0]], [-1.0], covering=[-1.0]), ss.SemismoothError, "covering"),
    ],
)
def test_misuse_is_refused_with_the_reason(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_lists_say_why_they_are_not_proven():
    curved = ss.all_solutions(ss.trace(lambda x: [ss.maximum(x[0], 0) * x[0] + x[0] - 2], 1))
    assert (curved.status, curved.complete) == ("searched", False) and "there may be others" in curved.completeness
    assert curved.points[:, 0] == pytest.approx([1.0])
    jump = ss.all_solutions(ss.trace(lambda x: [ss.where(x[0] > 0, x[0] + 1, -x[0])], 1))
    assert not jump.complete
    assert "the pieces do not agree" in jump.completeness
    rng = np.random.default_rng(0)
    cut = ss.all_solutions(ss.Lcp(-np.eye(12), np.ones(12) + rng.uniform(size=12)), max_nodes=10)
    assert cut.completeness.startswith("incomplete: ")


def test_piecewise_affine_maps_have_proven_lists_at_a_parameter():
    # Slopes 1, −1/4 and 39/4, with kinks at 1 and 3: the load 3/4 is met once on each.
    def beam(x):
        y, load = x
        return [y - 1.25 * ss.maximum(y - 1, 0) + 10 * ss.maximum(y - 3, 0) - load]

    found = ss.all_solutions(ss.trace(beam, 2), 0.75)
    assert found.complete and found.index_sum == 1
    np.testing.assert_allclose(sorted(found.points[:, 0]), [0.75, 2.0, 3 + 0.25 / 9.75], rtol=1e-15)
    by_pieces = {tuple(s.pieces[0]): s.index for s in found.solutions}
    assert by_pieces == {("second", "second"): 1, ("first", "second"): -1, ("first", "first"): 1}
