"""Variational inequalities, cones and friction against scipy and against their defining conditions."""

import json
import pathlib

import numpy as np
import pytest
import scipy.optimize
import scipy.sparse
import semismooth as ss

CRATE = pathlib.Path(__file__).parents[2]


@pytest.mark.parametrize("seed", range(5))
def test_projections_on_polyhedra_are_minima_of_scipy(seed):
    rng = np.random.default_rng(seed)
    A, b, E, point = rng.normal(size=(6, 4)), rng.uniform(0.2, 1.0, size=6), rng.normal(size=(1, 4)), 2 * rng.normal(size=4)
    result = ss.solve_vi(lambda x: x - point, np.zeros(4), lower=-1.0, A=A, b=b, E=E, d=[0.0])
    assert result.solved and result.residual < 1e-9
    constraints = [scipy.optimize.LinearConstraint(A, ub=b), scipy.optimize.LinearConstraint(E, 0, 0)]
    bounds = scipy.optimize.Bounds(-1.0, np.inf)
    minimum = scipy.optimize.minimize(
        lambda x: ((x - point) ** 2).sum(), np.zeros(4), jac=lambda x: 2 * (x - point), method="SLSQP", constraints=constraints, bounds=bounds, options={"ftol": 1e-14}
    )
    np.testing.assert_allclose(result.x, minimum.x, atol=1e-6)
    # F + Aᵀλ + Eᵀμ = ρₗ − ρᵤ, complementary.
    balance = result.x - point + A.T @ result.inequalities + E.T @ result.equations - result.lower + result.upper
    np.testing.assert_allclose(balance, 0, atol=1e-9)
    assert (result.inequalities >= 0).all() and result.inequalities @ (b - A @ result.x) == pytest.approx(0, abs=1e-9)


def test_affine_inequalities_without_solution_are_proven():
    # F = (1, 0) pushes to −∞ along a free direction of C.
    M, q = np.zeros((2, 2)), np.array([1.0, 0.0])
    result = ss.solve_vi((M, q), [0.0, 0.0], A=[[0.0, 1.0]], b=[1.0])
    assert result.status == "no solution" and not result.solved
    assert q @ result.ray < 0 and result.ray[1] <= 0
    empty = ss.solve_vi((np.eye(1), [0.0]), [0.0], A=[[1.0], [-1.0]], b=[-1.0, -1.0])
    assert empty.status == "empty set"


@pytest.mark.parametrize("seed", range(5))
def test_nearest_points_of_cones_have_closed_forms(seed):
    point = np.random.default_rng(seed).normal(size=6)
    result = ss.solve_cone((np.eye(6), -point), [("second-order", 3), ("nonnegative", 2), ("free", 1)])
    t, v = point[0], point[1:3]
    size = np.linalg.norm(v)
    second = point[:3] if size <= t else np.zeros(3) if size <= -t else (t + size) / 2 * np.array([1.0, *(v / size)])
    assert result.solved
    np.testing.assert_allclose(result.x, [*second, *np.maximum(point[3:5], 0), point[5]], atol=1e-9)
    traced = ss.solve_cone(lambda x: x - point, [("second-order", 3), ("nonnegative", 2), ("free", 1)])
    np.testing.assert_allclose(traced.x, result.x, atol=1e-9)


def test_semidefinite_cones_project_by_eigenvalues():
    rng = np.random.default_rng(7)
    given = rng.normal(size=(4, 4))
    given = given + given.T
    rows, columns = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T
    weights = np.where(rows == columns, 1.0, np.sqrt(2.0))
    point = given[rows, columns] * weights
    result = ss.solve_cone((np.eye(10), -point), [("semidefinite", 4)])
    values, vectors = np.linalg.eigh(given)
    nearest = (vectors * np.maximum(values, 0.0)) @ vectors.T
    assert result.solved
    np.testing.assert_allclose(result.x, nearest[rows, columns] * weights, atol=1e-9)


def test_cones_are_refused_by_name():
    with pytest.raises(ValueError, match="second-order"):
        ss.solve_cone((np.eye(1), [0.0]), [("round", 1)])
    with pytest.raises(ValueError, match="max_time"):
        ss.solve_cone((np.eye(1), [0.0]), [("free", 1)], max_time=-1.0)


@pytest.mark.parametrize("name", ["FrictionContactProblem00374", "OneObject-i1028-138", "Box_Stacks-i0122-82-5"])
def test_real_friction_problems_satisfy_their_laws(name):
    data = json.loads((CRATE / "tests" / "data" / "friction" / f"{name}.json").read_text(encoding="utf-8"))
    M, q, mu, d = data["M"], np.array(data["q"]), np.array(data["mu"]), data["dimension"]
    matrix = scipy.sparse.csc_matrix((M["data"], M["indices"], M["indptr"]), shape=(len(q), len(q)))
    seen = []
    result = ss.solve_friction(matrix, q, mu, callback=seen.append)
    assert result.solved and seen == result.history
    r, u = result.reactions, result.velocities
    assert r.shape == u.shape == (len(mu), d) and len(result.states) == len(mu)
    np.testing.assert_allclose(u.ravel(), matrix @ result.x + q, atol=1e-12 * np.abs(q).max())
    scale = np.abs(r).max()
    assert r[:, 0].min() >= -1e-10 * scale and (np.linalg.norm(r[:, 1:], axis=1) - mu * r[:, 0]).max() <= 1e-10 * scale
    # Signorini, and no slip where the traction is below its bound.
    assert u[:, 0].min() >= -1e-10 * np.abs(u).max()
    assert np.abs(r[:, 0] * u[:, 0]).max() <= 1e-9 * scale * np.abs(u).max()
    inside = np.linalg.norm(r[:, 1:], axis=1) < mu * r[:, 0] - 1e-6 * scale
    assert inside.sum() == 0 or np.abs(u[inside]).max() <= 1e-8 * np.abs(u).max()


@pytest.mark.parametrize("push", [0.2, 0.5, -0.5])
def test_a_block_sticks_or_slips(push):
    result = ss.solve_friction(np.eye(2), [-1.0, -push], [0.3])
    # Pushed towards negative velocities: friction acts along T1.
    assert result.states == ["stick" if abs(push) <= 0.3 else "slip-" if push > 0 else "slip+"]
    np.testing.assert_allclose(result.reactions, [[1.0, np.clip(push, -0.3, 0.3)]], atol=1e-12)


def test_affine_functions_as_matrix_and_vector():
    M, q = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-5.0, -1.0])
    np.testing.assert_allclose(ss.solve_mcp((M, q), 0.0, np.inf, [0.0, 0.0]).x, [2.5, 0.0], atol=1e-12)
    with pytest.raises(ValueError, match="shape"):
        ss.solve_mcp((M, q), 0.0, np.inf, [0.0])
    # 0 ≤ z ⟂ z − α ≥ 0.
    branch = ss.follow(([[1.0, -1.0]], [0.0]), [0.0, -1.0], (-1.0, 1.0), lower=0.0)
    np.testing.assert_allclose([t.x for t in branch.transitions], [[0.0, 0.0]], atol=1e-15)
