"""Functions written for numpy are traced as they are: values and derivatives are those of the same function called with numbers."""

import math
import threading

import numpy as np
import pytest
import scipy.sparse as sp
from scipy import special
import semismooth as ss

STIFF = sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(4, 4), format="csr")
FULL = STIFF.toarray()
POINTS = np.random.default_rng(3).uniform(0.05, 0.95, size=(5, 4))


def loop(x):
    out = np.zeros(4)
    for i in range(4):
        out[i] = max(x[i], 0.5, x[0]) - min(x[i] ** 2, 0.3) + math.exp(x[i])
    out[1:] += x[:-1]
    out += 2 * x
    np.add.at(out, [0, 0, 3], x[:3])
    return out


def masked(x):
    y = x.copy()
    y[y < 0.4] = 0.4
    return y


def grid(x):
    padded = np.concatenate([[0.0], x, [1.0]])
    return padded[2:] - 2 * padded[1:-1] + padded[:-2]


FUNCTIONS = {
    "maximum": lambda x: np.maximum(x, 0.5) + np.minimum(x, [0.1, 0.2, 0.9, 0.4]) + np.fmax(x, x[0]),
    "maximum of many": lambda x: [np.maximum.reduce(x), ss.maximum(x[0], x[1], 0.3, x[2]), ss.minimum(*x)],
    "absolute": lambda x: np.abs(x - 0.5) + abs(x - 0.3) + np.fabs(x - 0.7),
    "clip": lambda x: [*np.clip(x, 0.3, 0.6), *x.clip(0.4, None), *np.clip(x, None, 0.6), x[0].clip(0.2, 0.3)],
    "where": lambda x: np.where(x > 0.5, x**2, 0.5 * x),
    "and": lambda x: np.where((x > 0.2) & (x < 0.7), (x - 0.2) * (x - 0.7), 0),
    "or": lambda x: np.where((x < 0.2) | ~(x < 0.7), (x - 0.2) * (x - 0.7), 0),
    "products with comparisons": lambda x: (x - 0.5) * (x > 0.5) + (x < 0.5) * (x - 0.5) ** 2,
    "sign": lambda x: np.sign(x - 0.5) * (x - 0.5) ** 2,
    "select": lambda x: np.select([x < 0.3, x < 0.6], [0 * x, x - 0.3], 0.3),
    "piecewise": lambda x: np.piecewise(x, [x < 0.5, x >= 0.5], [lambda x: 0.5 - x, lambda x: x - 0.5]),
    "sums": lambda x: [np.sum(x), x.sum(), sum(x), np.mean(x), x.mean(), np.prod(x), np.average(x, weights=[1, 2, 3, 4])],
    "products": lambda x: [np.dot(x, x), x @ x, x.dot(x), np.inner(x, x), np.vdot(x, x), (FULL @ x) @ x, x @ FULL @ x],
    "matrices": lambda x: np.concatenate([FULL @ x, x @ FULL, np.dot(FULL, x), STIFF @ x, x @ STIFF, STIFF.dot(x), STIFF.T @ x]),
    "kinds of sparse matrices": lambda x: STIFF.tocoo() @ x + STIFF.tocsc() @ x + sp.csr_array(STIFF) @ x + sp.eye(4) @ x,
    "columns": lambda x: STIFF @ np.stack([x, 2 * x], axis=1),
    "stacks": lambda x: np.concatenate([np.stack([x, x])[1], np.hstack([x[0], x]), np.vstack([x, x])[0], np.r_[x[0], x, 1.0]]),
    "cumulative": lambda x: np.concatenate([np.cumsum(x), np.diff(x), np.cumprod(x), np.maximum.accumulate(x), np.diff(x, n=2)]),
    "extrema": lambda x: [np.max(x), x.max(), np.amin(x), x.min(), max(x), min(x), max(x[0], 0.5), np.ptp(x)],
    "orders": lambda x: np.concatenate([np.sort(x), [np.median(x), np.median(x[:3])], np.sort(x.reshape(2, 2), axis=0).ravel()]),
    "blocks": lambda x: np.concatenate([np.block([[x[:2], x[2:]], [x[2:], x[:2]]]).ravel(), np.block([x, 1.0])]),
    "none is missing": lambda x: [np.nanmax(x), np.nanmin(x), np.nansum(x), np.nanmean(x)],
    "of scipy.special": lambda x: np.concatenate([special.expit(x - 0.5), special.logit(x)]),
    "norms": lambda x: [np.linalg.norm(x), np.linalg.norm(x, 1), np.linalg.norm(x, np.inf), np.linalg.norm(x[:2]), np.linalg.norm(x, 3)],
    "norms of rows": lambda x: np.linalg.norm(x.reshape(2, 2), axis=1),
    "inverse functions": lambda x: np.concatenate([np.arcsin(x), np.arccos(x), np.arctan2(x, x[0] - 0.5), np.arctanh(x), np.arcsinh(x - 0.5)]),
    "logarithms": lambda x: np.concatenate([np.log1p(x), np.expm1(x), np.log10(x), np.log2(x), np.exp2(x), np.arccosh(1 + x)]),
    "roots": lambda x: np.concatenate([np.cbrt(x - 0.5), np.hypot(x, x[0]), np.square(x), np.reciprocal(x), np.logaddexp(x, x[0])]),
    "interp": lambda x: np.interp(x, [0.1, 0.3, 0.5, 0.8], [1.0, 2.0, 2.0, -1.0]),
    "loop": loop,
    "masked": masked,
    "grid": grid,
    "math": lambda x: [math.sin(x[0]), math.log(x[1], 2), math.hypot(x[0], x[1]), math.pow(x[0], 3), math.atan2(x[0], x[1]), math.sqrt(x[2])],
    "arrays": lambda x: np.array([np.maximum(x[0], 0.5), x[1]]) + np.asarray(x[2:], dtype=float) + np.ones(2) * x[0],
    "arrays alike": lambda x: np.zeros_like(x) + np.ones_like(x) * x + np.full_like(x, 0.5),
    "lists": lambda x: np.maximum([x[0], 0.3], [0.5, x[1]]) + np.linalg.norm([x[0], x[1]]),
    "shapes": lambda x: np.concatenate([x.reshape(2, 2).T.ravel(), np.roll(x, 1), np.tile(x, 2), x[::-1], np.outer(x, x).ravel(), np.append(x, 1)]),
    "sums of products": lambda x: np.einsum("i,ij->j", x, FULL) + np.tensordot(FULL, x, axes=1) + np.polyval([1.0, 2.0, 3.0], x),
    "solutions of linear systems": lambda x: np.linalg.solve(FULL, x),
    "own test for arrays": lambda x: x if isinstance(x, np.ndarray) else None,
    "scalar": lambda x: x[0] * 2,
    "parts": lambda x: [x, x[0]] if x.dtype == object else np.append(x, x[0]),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_values_and_derivatives_are_those_of_the_function(name):
    function = FUNCTIONS[name]
    traced = ss.trace(function, 4)
    for x in POINTS:
        plain = np.ravel(np.array(function(x), dtype=float))
        np.testing.assert_allclose(traced(x), plain, rtol=1e-13, atol=1e-13)
        step = 1e-6

        def central(e):
            return (np.ravel(np.array(function(x + step * e), float)) - np.ravel(np.array(function(x - step * e), float))) / (2 * step)

        quotients = np.stack([central(e) for e in np.eye(4)], axis=1)
        np.testing.assert_allclose(traced.jacobian(x), quotients, rtol=1e-6, atol=1e-6)


def test_tiny_arguments_keep_their_digits():
    traced = ss.trace(lambda x: [np.log1p(x[0]), np.expm1(x[0]), np.arcsin(x[0]), np.arcsinh(x[0]), np.arctanh(x[0])], 1)
    np.testing.assert_allclose(traced([1e-14]), 1e-14, rtol=1e-13)
    np.testing.assert_allclose(traced.jacobian([1e-14]), 1.0, rtol=1e-13)
    assert ss.trace(lambda x: np.arccos(x), 1)([1 - 1e-10])[0] == pytest.approx(np.arccos(1 - 1e-10), rel=1e-14)


def test_knots_of_interp_are_kinks():
    # Slopes 0, 2, 2, -1, 0: a kink at each knot but the second, where the slope stays.
    traced = ss.trace(lambda x: np.interp(x, [0.0, 1.0, 2.0, 3.0], [0.0, 2.0, 4.0, 3.0]), 1)
    assert traced.num_sites == 3
    found = ss.all_solutions(ss.trace(lambda x: np.interp(x, [0.0, 1.0, 2.0, 3.0], [0.0, 2.0, 4.0, 3.0]) - 3.5, 1))
    assert found.complete and sorted(found.points[:, 0].round(12)) == [1.75, 2.5]


def test_zeros_of_a_matrix_are_no_entries():
    branch = ss.follow(lambda x: FULL @ x[:4] - x[4], np.zeros(5), parameter_range=(0.0, 1.0))
    assert branch.points[-1][:4] == pytest.approx(np.linalg.solve(FULL, np.ones(4)))


def test_patterns_follow_the_operations():
    # x₀ + x₁ + … + x₉ as one long sum, a value used twice, nested kinks.
    def function(x):
        total = sum(x)
        inner = np.maximum(x[0], x[1])
        return [total, inner + total, np.maximum(inner, x[2]), 3.0 + 0 * x[0] ** 0]

    traced = ss.trace(function, 10)
    x = np.arange(10.0)
    expected = np.zeros((4, 10))
    expected[0] = expected[1] = 1.0
    expected[1, 1] = 2.0
    expected[2, 2] = 1.0
    np.testing.assert_array_equal(traced.jacobian(x), expected)
    assert traced.num_sites == 2


def test_the_functions_of_the_module_are_as_before():
    before = dict(globals())
    ss.trace(loop, 4)
    with pytest.raises(TypeError):
        ss.trace(lambda x: [1.0 if x[0] > 0 else 2.0], 1)
    assert {k: v for k, v in globals().items() if before.get(k, v) is not v} == {}
    assert globals().keys() == before.keys()
    assert np.zeros(2).dtype == float and max(1, 2) == 2


def test_other_threads_keep_their_numpy():
    inside, done = threading.Event(), threading.Event()
    found = []

    def waiting(x):
        inside.set()
        done.wait(10)
        return np.zeros(1) + x

    def meanwhile():
        inside.wait(10)
        found.append((np.zeros(3), max(3, 4), np.maximum([1.0], 2.0)))
        done.set()

    thread = threading.Thread(target=meanwhile)
    thread.start()
    assert ss.trace(waiting, 1)([2.0]) == 2.0
    thread.join()
    (zeros, largest, maximum), = found
    assert zeros.dtype == float and type(zeros) is np.ndarray and largest == 4 and maximum == 2.0


def test_semismooth_numpy_is_numpy():
    import semismooth.numpy as snp

    assert snp.zeros is np.zeros and snp.maximum is np.maximum and snp.pi == np.pi and snp.ndarray is np.ndarray

    def function(x):
        out = snp.zeros(2)
        out[0] = snp.maximum(x[0], 1)
        return out

    assert ss.trace(function, 1)([3.0]).tolist() == [3.0, 0.0]


@pytest.mark.parametrize(
    "function, sentence",
    [
        (lambda x: [1.0 if x[0] > 0 else 2.0], r"numpy\.where\(x > 0, a, b\)"),
        (lambda x: [x[0] if 0 < x[0] < 1 else 0.0], r"&"),
        (lambda x: x[x > 0], r"numpy\.where"),
        (lambda x: np.floor(x), r"floor jumps"),
        (lambda x: [x[0] == 1.0], r"== or !="),
        (lambda x: x[np.argsort(x)], r"chooses by values"),
        (lambda x: [float(x[0])], r"zeros_like"),
        (lambda x: np.interp(x, [0.0, 1.0], [0.0, 1.0], left=-1.0), r"jumps"),
        (lambda x: np.linalg.solve(np.outer(x, x), x), r"unknowns"),
        (lambda x: np.linalg.eigvals(np.outer(x, x)), r"eigvals"),
    ],
)
def test_what_cannot_be_traced_says_what_to_write(function, sentence):
    with pytest.raises(TypeError, match=sentence):
        ss.trace(function, 2)


# Models of several fields, as they are written for numpy.


@pytest.mark.parametrize("floor, binds", [(1.2, True), (0.1, False)])
def test_leontief_prices_with_a_floor_on_the_wage(floor, binds):
    use = np.array([[0.2, 0.3, 0.1], [0.4, 0.1, 0.2], [0.1, 0.3, 0.3]])
    labour = np.array([0.5, 0.4, 0.6])

    def prices(p):
        wage = np.maximum(0.2 + 0.1 * np.mean(p), floor)
        return p - use.T @ p - wage * labour

    found = ss.solve(prices, np.ones(3))
    assert found.solved
    on_the_floor = np.linalg.solve(np.eye(3) - use.T, floor * labour)
    above = np.linalg.solve(np.eye(3) - use.T - 0.1 * np.outer(labour, np.ones(3)) / 3, 0.2 * labour)
    np.testing.assert_allclose(found.x, on_the_floor if binds else above, rtol=1e-9)
    assert (0.2 + 0.1 * np.mean(found.x) < floor) == binds


def test_traffic_in_equilibrium():
    # Two routes of five links; Wardrop: used routes have the least cost. min(h, c(h) − u) = 0 and the demand is met.
    incidence = np.array([[1, 0, 1], [1, 1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 0]], dtype=float)
    free, capacity = np.array([1.0, 1.5, 1.2, 0.8, 1.0]), np.array([2.0, 1.0, 2.0, 1.5, 1.0])
    demand = 4.0

    def wardrop(z):
        h, u = z[:3], z[3]
        v = incidence @ h
        t = free * (1 + 0.15 * (v / capacity) ** 4)
        cost = incidence.T @ t
        return np.concatenate([np.minimum(h, cost - u), [np.sum(h) - demand]])

    found = ss.solve(wardrop, np.array([1.0, 1.0, 1.0, 3.0]))
    assert found.solved
    h, u = found.x[:3], found.x[3]
    cost = incidence.T @ (free * (1 + 0.15 * (incidence @ h / capacity) ** 4))
    assert h.sum() == pytest.approx(demand) and np.all(h >= -1e-9) and np.all(cost >= u - 1e-7)
    assert h @ (cost - u) == pytest.approx(0, abs=1e-7)


def test_obstacle_by_finite_differences():
    n = 60
    x = np.linspace(0, 1, n + 2)[1:-1]
    laplace = sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n)) * (n + 1) ** 2
    psi = 0.1 - (x - 0.5) ** 2 * 2

    def residual(u):
        return np.minimum(laplace @ u + 1.0, u - psi)

    found = ss.solve(residual, np.zeros(n))
    assert found.solved
    expected = ss.solve_lcp(laplace, laplace @ psi + 1.0).x + psi
    np.testing.assert_allclose(found.x, expected, atol=1e-9)


def test_diodes_in_a_circuit():
    # A bridge rectifier with ideal diodes: 0 ≤ i ⟂ v ≥ 0 as min(i, v), against the same as one complementarity problem.
    resistance = np.array([[2.0, 1.0, 0.0, 1.0], [1.0, 2.0, 1.0, 0.0], [0.0, 1.0, 2.0, 1.0], [1.0, 0.0, 1.0, 2.5]])
    source = np.array([-1.0, 1.0, -1.0, 1.0])

    def circuit(i):
        out = np.empty(4)
        for k in range(4):
            out[k] = min(i[k], resistance[k] @ i + source[k])
        return out

    found = ss.solve(circuit, np.zeros(4))
    assert found.solved
    i, v = found.x, resistance @ found.x + source
    assert np.all(i >= -1e-9) and np.all(v >= -1e-9) and i @ v == pytest.approx(0, abs=1e-9)


def test_signorini_from_matrices():
    # A chain of springs above the ground, pressed down at its end: K u − f = Bᵀ λ with λ = max(λ − r (B u + gap), 0).
    n = 20
    stiffness = sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n)).tolil()
    stiffness[-1, -1] = 1.0
    stiffness = stiffness.tocsr()
    trace = sp.eye(n).tocsr()[5:]
    gap, load = np.full(n - 5, 0.3), np.zeros(n)
    load[-1] = -0.2

    def signorini(z):
        u, pressure = z[:n], z[n:]
        balance = stiffness @ u - load - trace.T @ pressure
        contact = pressure - np.maximum(pressure - (trace @ u + gap), 0)
        return np.hstack([balance, contact])

    found = ss.solve(signorini, np.zeros(2 * n - 5))
    assert found.solved
    u, pressure = found.x[:n], found.x[n:]
    lifted = trace @ u + gap
    assert np.all(lifted >= -1e-9) and np.all(pressure >= -1e-9) and lifted @ pressure == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(stiffness @ u - load, trace.T @ pressure, atol=1e-9)
    assert pressure.max() > 0.01


def test_american_put_by_implicit_steps():
    strike, rate, volatility, n = 1.0, 0.05, 0.3, 80
    s = np.linspace(0, 3, n + 1)
    payoff = np.maximum(strike - s, 0)
    i = np.arange(1, n)
    dt = 1 / 20
    a, b = 0.5 * volatility**2 * i**2, 0.5 * rate * i
    step = sp.diags([-(a - b)[1:] * dt, 1 + (2 * a + rate) * dt, -(a + b)[:-1] * dt], [-1, 0, 1], format="csr")

    def stage(v, before):
        below = np.zeros(n - 1)
        below[0] = (a - b)[0] * dt * payoff[0]
        return np.minimum(step @ v - before - below, v - payoff[1:-1])

    value = payoff[1:-1]
    for _ in range(20):
        found = ss.solve(lambda v: stage(v, value), value)
        assert found.solved
        value = found.x
    at_the_money = np.interp(1.0, s[1:-1], value)
    # The binomial model with 4 000 steps gives 0.0996; 20 steps in time and a coarse grid are near.
    assert at_the_money == pytest.approx(0.0987, abs=2e-3)
    assert np.all(value >= payoff[1:-1] - 1e-10)
