"""Traced formulas against the same Python functions called with numbers."""

import math

import numpy as np
import pytest
import semismooth as ss


def everything(x):
    a, b, c = x
    return [
        a * b - 2 / (c + 3) + 1.5**a - a**2.5 + b**-2 + (a + 1) ** b,
        np.sqrt(a) * np.exp(b) - np.log(c) + np.sin(a) * np.cos(b) - np.tan(c / 3),
        np.sinh(a) + np.cosh(b) * np.tanh(c) - np.arctan(a * b) - (+a) - (-b),
        ss.maximum(a * b, c) + ss.minimum(a, 2 * c) * abs(a - b),
        ss.clip(a + b, -1.0, c) + ss.where(a > b, a * a, b * (2 * a - b)),
    ]


POINTS = np.random.default_rng(1).uniform(0.2, 2.5, size=(40, 3))


@pytest.mark.parametrize("x", POINTS)
def test_values_are_those_of_the_function(x):
    traced = ss.trace(everything, 3)
    np.testing.assert_allclose(traced(x), np.array(everything(x), dtype=float), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("x", POINTS)
def test_jacobians_are_those_of_difference_quotients(x):
    # Richardson's extrapolation of central differences; points this near a kink would mix two pieces.
    def central(h):
        columns = [(np.array(everything(x + h * e), dtype=float) - np.array(everything(x - h * e), dtype=float)) / (2 * h) for e in np.eye(3)]
        return np.stack(columns, axis=1)

    a, b, c = x
    kinks = [a * b - c, a - 2 * c, a - b, a + b - c]
    if min(map(abs, kinks)) < 1e-2:
        pytest.skip("near a kink")
    expected = (4 * central(5e-4) - central(1e-3)) / 3
    np.testing.assert_allclose(ss.trace(everything, 3).jacobian(x), expected, rtol=1e-8, atol=1e-8)


def test_kinks_are_sites_with_named_pieces():
    traced = ss.trace(everything, 3)
    assert (traced.num_vars, traced.num_residuals, traced.num_sites) == (3, 5, 5)
    assert traced.pieces([1.0, 2.0, 1.0]) == ["first", "first", "negative", "upper", "second"]
    assert traced.pieces([2.0, -5.0, 1.0]) == ["second", "first", "positive", "lower", "first"]


def test_equal_kinks_are_one_site_and_unused_ones_none():
    def twice(x):
        unused = abs(x[0] - 7)
        assert unused is not None
        return [ss.maximum(x[0], 0) + ss.maximum(x[0], 0)]

    assert ss.trace(twice, 1).num_sites == 1
    assert ss.trace(twice, 1)([2.0]) == 4.0


def test_matrices_and_broadcasting_are_traced():
    matrix = np.arange(6.0).reshape(2, 3)
    traced = ss.trace(lambda x: ss.maximum(matrix @ x - 1, [0.0, 5.0]), 3)
    x = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(traced(x), np.maximum(matrix @ x - 1, [0.0, 5.0]))
    column = ss.trace(lambda x: x.reshape(3, 1) * np.array([1.0]), 3)
    np.testing.assert_array_equal(column(x), x)


def test_functions_of_numbers_are_those_of_numpy():
    a, b = np.array([1.0, -2.0]), np.array([0.0, 3.0])
    np.testing.assert_array_equal(ss.maximum(a, b), np.maximum(a, b))
    np.testing.assert_array_equal(ss.minimum(a, b), np.minimum(a, b))
    np.testing.assert_array_equal(ss.clip(a, -1.0, 0.5), [0.5, -1.0])
    np.testing.assert_array_equal(ss.where(a > b, a, b), [1.0, 3.0])


def test_sinh_cancels_nothing_near_zero():
    assert ss.trace(lambda x: np.sinh(x), 1)([1e-12])[0] == pytest.approx(1e-12, rel=1e-15)


@pytest.mark.parametrize(
    "function",
    [
        lambda x: [1.0 if x[0] > 0 else 2.0],
        lambda x: [math.floor(x[0])],
        lambda x: [float(x[0])],
        lambda x: [1.0 if x[0] == 2.0 else 0.0],
        lambda x: [x[0] and x[1]],
        lambda x: ["a"],
        lambda x: None,
    ],
)
def test_what_cannot_be_traced_is_a_type_error(function):
    with pytest.raises(TypeError):
        ss.trace(function, 2)


def test_expressions_of_two_functions_do_not_mix():
    kept = []
    ss.trace(lambda x: kept.append(x[0]) or [x[0]], 1)
    with pytest.raises(ValueError, match="two traced functions"):
        ss.trace(lambda x: [x[0] + kept[0]], 1)


def test_exceptions_of_the_function_come_out_unchanged():
    error = LookupError("mine")

    def failing(x):
        raise error

    with pytest.raises(LookupError) as caught:
        ss.trace(failing, 1)
    assert caught.value is error


def test_what_is_undefined_stays_so():
    with np.errstate(all="ignore"):
        for kink in (
            lambda x: ss.maximum(x + 2, np.log(x)),
            lambda x: ss.minimum(np.log(x), x),
            lambda x: ss.clip(np.log(x), -1, 1),
            lambda x: abs(np.log(x)) ** 0,
            lambda x: ss.where(x > -5, np.log(x), x),
            lambda x: ss.where(x > -2, np.log(x), x + 2),
        ):
            assert np.isnan(ss.trace(lambda x: [kink(x[0])], 1)([-2.0])).all()
            found = ss.solve_mcp(lambda x: [kink(x[0])], -np.inf, np.inf, [-2.0])
            assert not (found.status == "solved" and np.isnan(kink(found.x[0])))
    assert ss.trace(lambda x: [ss.where(x[0] > 0, x[0], np.log(-x[0]))], 1)([2.0]) == [2.0]
