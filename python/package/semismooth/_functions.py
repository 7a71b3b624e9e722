"""Kinks, element by element: traced for expressions, numpy's functions for numbers."""

from collections.abc import Callable
from typing import Any

import numpy as np

from . import _core


def _elementwise(traced: Callable[..., Any], plain: Callable[..., Any], *arguments: Any) -> Any:
    arrays = [np.asarray(a) for a in arguments]
    if all(a.dtype != object for a in arrays):
        return plain(*arguments)
    return np.frompyfunc(traced, len(arrays), 1)(*arrays)


def maximum(a: Any, b: Any) -> Any:
    """The larger of a and b, element by element; each pair is a site with the pieces "first" and "second".

    >>> import semismooth as ss
    >>> ss.maximum([1.0, -2.0], 0.0)
    array([1., 0.])
    """
    return _elementwise(_core.traced_maximum, np.maximum, a, b)


def minimum(a: Any, b: Any) -> Any:
    """The smaller of a and b, element by element; each pair is a site with the pieces "first" and "second"."""
    return _elementwise(_core.traced_minimum, np.minimum, a, b)


def clip(x: Any, lower: Any, upper: Any) -> Any:
    """The projection of x on [lower, upper], lower ≤ upper, element by element; each is a site with the pieces "lower", "interior", "upper"."""
    return _elementwise(_core.traced_clip, np.clip, x, lower, upper)


def where(condition: Any, a: Any, b: Any) -> Any:
    """a where the condition holds, else b, element by element; each comparison is a site with the pieces "first" and "second".

    The two formulas must agree where the sides of the comparison are equal: a map that jumps there is not piecewise smooth, and
    results are then wrong.

    >>> import semismooth as ss
    >>> huber = ss.trace(lambda x: [ss.where(x[0] < 1, x[0] ** 2, 2 * x[0] - 1)], 1)
    >>> huber([0.5]), huber([2.0])
    (array([0.25]), array([3.]))
    """
    return _elementwise(_core.traced_where, np.where, condition, a, b)


def of_one(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The same function of an array with one entry."""
    return function if isinstance(function, _core.Map) else lambda x: [function(x[0])]


def of_two(function: Callable[[Any, Any], Any]) -> Callable[[Any], Any]:
    """The same function of an array with two entries."""
    return function if isinstance(function, _core.Map) else lambda x: [function(x[0], x[1])]
