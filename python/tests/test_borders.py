"""No panic of the library comes through: whatever is given, there is a result or an exception of Python."""

import itertools

import numpy as np
import pytest
import semismooth as ss

HOSTILE = [
    None,
    "text",
    np.nan,
    np.inf,
    -1,
    10**30,
    [],
    [[]],
    [np.nan, 1.0],
    [np.inf, -np.inf],
    [1e308, -1e308],
    [0.0, 0.0],
    [[0.0, 0.0], [0.0, 0.0]],
    [[np.nan, 1.0], [1.0, 1.0]],
    [[1e308, 1e308], [1e308, 1e308]],
    np.zeros((2, 3)),
    np.zeros((1, 2, 3)),
    np.array(["a", "b"]),
    lambda x: x,
    lambda x: [x[0] / 0.0, x[0]],
    lambda x: [np.nan, np.nan],
    lambda x: None,
    ss.trace(lambda x: [x[0] / x[0], ss.maximum(x[0], x[1])], 2),
]

FUNCTIONS = [
    ss.Lcp,
    ss.all_solutions,
    ss.diagram,
    ss.follow,
    ss.lemke,
    ss.solve,
    ss.solve_cone,
    ss.solve_friction,
    ss.solve_lcp,
    ss.solve_mcp,
    ss.solve_vi,
    ss.trace,
    ss.transition_set,
    ss.Material,
    ss.Mesh,
    ss.Mesh.rectangle,
    ss.Mesh.block,
    ss.Foundation.plane,
    ss.Foundation.gap,
    ss.Friction,
    ss.Friction.table,
    ss.Friction.exponential,
    ss.Friction.function,
]


def call(function, *arguments, **options):
    """The panics of pyo3 are no `Exception`, so that they come through here."""
    try:
        function(*arguments, **options)
    except Exception:
        pass


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_hostile_arguments_raise_exceptions(function):
    for first in HOSTILE:
        call(function, first)
        for second in HOSTILE:
            call(function, first, second)
    for three in itertools.product(HOSTILE[6:14], repeat=3):
        call(function, *three)


def test_functions_that_change_their_minds_raise_exceptions():
    def shrinking():
        sizes = iter([2, 2, 2, 1, 3, 0])
        return lambda x: np.zeros(next(sizes, 2))

    for jac in ("differences", lambda x: np.zeros((1, 7)), lambda x: np.full((2, 2), np.nan)):
        for lower in (0.0, -np.inf):
            call(ss.solve_mcp, shrinking(), lower, np.inf, [1.0, 1.0], jac=jac)
            call(ss.solve_vi, shrinking(), [1.0, 1.0], lower=lower, jac=jac)
        call(ss.follow, shrinking(), [1.0, 1.0, 1.0], jac=jac)


def test_the_test_would_see_a_panic():
    class Panic(BaseException):
        pass

    def panics():
        raise Panic

    with pytest.raises(Panic):
        call(panics)
