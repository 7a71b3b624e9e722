"""Models as people write them for numpy and scipy, with one of our solvers at the end: against the fixed points, optima and balances that
their fields know."""

import numpy as np
import pytest
import scipy.sparse as sp
import semismooth as ss
from scipy import optimize


def test_clearing_payments_of_banks():
    # Eisenberg and Noe (2001): p = min(L, Πᵀ p + e), by their iteration.
    rng = np.random.default_rng(0)
    n = 50
    debts = rng.random((n, n)) * (rng.random((n, n)) < 0.2)
    np.fill_diagonal(debts, 0)
    owed = debts.sum(axis=1)
    shares = np.divide(debts, owed[:, None], out=np.zeros_like(debts), where=owed[:, None] > 0)
    cash = 0.5 * rng.random(n)

    def gap(p):
        return p - np.minimum(owed, shares.T @ p + cash)

    result = ss.solve(gap, owed.copy())
    paid = owed.copy()
    for _ in range(2000):
        paid = np.minimum(owed, shares.T @ paid + cash)
    assert result.solved
    np.testing.assert_allclose(result.x, paid, atol=1e-12)
    assert (result.x < owed - 1e-6).any()


def test_routes_in_equilibrium():
    # Wardrop: travel times of used routes are equal, those of others no shorter. Complementarity as someone wrote it by hand.
    incidence = np.array([[1, 1, 0, 0], [0, 1, 1, 0], [1, 0, 1, 0], [0, 0, 0, 1]], dtype=float)
    free, capacity, demand = np.array([10.0, 12.0, 15.0, 80.0]), np.array([20.0, 30.0, 25.0, 5.0]), 40.0

    def times(h):
        flow = incidence @ h
        return incidence.T @ (free * (1 + 0.15 * np.power(flow / capacity, 4)))

    def residual(z):
        h, least = z[:4], z[4]
        excess = times(h) - least
        return np.concatenate((np.sqrt(h**2 + excess**2) - h - excess, [h.sum() - demand]))

    result = ss.solve(residual, [10.0, 10.0, 20.0, 1.0, 30.0])
    assert result.solved
    h, t = result.x[:4], times(result.x[:4])
    used = h > 1e-6
    assert h.sum() == pytest.approx(demand) and used.sum() == 3
    np.testing.assert_allclose(t[used], t[used].min(), rtol=1e-8)
    assert t[~used].min() > t[used].max()


def test_american_put_by_crank_nicolson():
    grid = np.linspace(0, 300, 301)
    strike, rate, vol, years, steps = 100.0, 0.05, 0.3, 1.0, 50
    dt = years / steps
    i = np.arange(1, 300)
    down, up = 0.5 * dt * (vol**2 * i**2 - rate * i), 0.5 * dt * (vol**2 * i**2 + rate * i)
    mid = dt * (vol**2 * i**2 + rate)
    implicit = sp.diags([-down[1:] / 2, 1 + mid / 2, -up[:-1] / 2], [-1, 0, 1], format="csr")
    explicit = sp.diags([down[1:] / 2, 1 - mid / 2, up[:-1] / 2], [-1, 0, 1], format="csr")
    payoff = np.maximum(strike - grid, 0)[1:-1]
    value = payoff.copy()
    for _ in range(steps):
        rhs = explicit @ value
        rhs[0] += down[0] * strike
        found = ss.solve_lcp(implicit, implicit @ payoff - rhs)
        assert found.solved
        value = found.x + payoff
    # By a binomial tree of 5 000 steps (Cox, Ross and Rubinstein).
    n = 5000
    h = years / n
    u = np.exp(vol * np.sqrt(h))
    p = (np.exp(rate * h) - 1 / u) / (u - 1 / u)
    prices = 100 * u ** (2.0 * np.arange(n + 1) - n)
    tree = np.maximum(strike - prices, 0)
    for k in range(n - 1, -1, -1):
        prices = prices[: k + 1] * u
        tree = np.maximum(np.exp(-rate * h) * (p * tree[1 : k + 2] + (1 - p) * tree[: k + 1]), strike - prices)
    assert np.interp(100, grid[1:-1], value) == pytest.approx(tree[0], abs=0.01)


def test_lasso_as_a_fixed_point():
    rng = np.random.default_rng(2)
    a, b, weight = rng.normal(size=(30, 12)), rng.normal(size=30), 4.0
    soft = lambda v, t: np.sign(v) * np.maximum(np.abs(v) - t, 0)  # noqa: E731
    result = ss.solve(lambda x: x - soft(x - a.T @ (a @ x - b) / 50, weight / 50), np.zeros(12))
    assert result.solved
    gradient = a.T @ (a @ result.x - b)
    used = np.abs(result.x) > 1e-10
    assert 0 < used.sum() < 12
    np.testing.assert_allclose(gradient[used], -weight * np.sign(result.x[used]), rtol=1e-9)
    assert np.abs(gradient[~used]).max() <= weight


def test_squared_hinge_loss():
    rng = np.random.default_rng(1)
    data = rng.normal(size=(80, 5))
    labels = np.sign(data[:, 0] + 0.3 * rng.normal(size=80))

    def loss(w):
        return 0.5 * w @ w + 0.5 * (np.maximum(0, 1 - labels * (data @ w)) ** 2).sum()

    def gradient(w):
        margin = np.maximum(0, 1 - labels * (data @ w))
        return w - data.T @ (labels * margin)

    result = ss.solve(gradient, np.zeros(5))
    other = optimize.minimize(loss, np.zeros(5), jac=lambda w: np.asarray(gradient(w), dtype=float), tol=1e-12)
    assert result.solved
    np.testing.assert_allclose(result.x, other.x, atol=1e-5)
    assert loss(result.x) <= other.fun + 1e-12


def test_gas_network_over_its_load():
    # Weymouth: p₁² − p₂² = R q |q|. The sign of a flow changes at some load.
    incidence = np.array([[1, -1, 0, 0], [0, 1, -1, 0], [0, 1, 0, -1], [0, 0, 1, -1]], dtype=float)
    resistance = np.array([1.0, 2.0, 1.5, 3.0])
    inlet = 50.0

    def network(z):
        squares, q, load = np.concatenate([[inlet], z[:3]]), z[3:7], z[7]
        out = np.zeros(7)
        out[:4] = incidence @ squares - resistance * q * np.abs(q)
        out[4:] = (incidence.T @ q)[1:] + np.array([0.5, 1.0, 0.7]) * load - np.array([0, 0, 0.3])
        return out

    start = np.r_[49, 48, 48, 1.0, 0.5, 0.5, 0.1, 0.5]
    branch = ss.follow(network, start, (0.3, 3.0), monitors={"reversal": lambda z: z[6]})
    assert branch.termination == "bound of the parameter"
    for z in branch.points:
        np.testing.assert_allclose(np.asarray(network(z), dtype=float), 0, atol=1e-8)
    # At the reversal the pressures at the ends of the pipe are one.
    for crossing in branch.crossings:
        assert crossing.x[1] == pytest.approx(crossing.x[2], abs=1e-7)


def test_reservoirs_in_a_row_spill():
    def balance(z):
        storage, rain = z[:-1], z[-1]
        spill = np.where(storage > 1.0, 0.5 * (storage - 1.0), 0.0) + 0.1 * storage
        inflow = np.concatenate([[rain], spill[:-1]])
        return inflow - spill

    branch = ss.follow(balance, np.zeros(7), (0.0, 3.0))
    # All spill what rains: from rain 0.1 on beyond the brim.
    assert [t.kind for t in branch.transitions] == ["pass-through"]
    np.testing.assert_allclose(branch.transitions[0].x, [1.0] * 6 + [0.1], atol=1e-12)
    np.testing.assert_allclose(branch.points[-1][:-1], (3.0 + 0.5) / 0.6, rtol=1e-12)
