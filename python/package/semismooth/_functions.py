"""Kinks, element by element: traced for expressions, numpy's functions for numbers."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from . import _arrays, _core


def _kink(traced: Callable[..., Any], plain: Callable[..., Any], arguments: tuple[Any, ...], name: str | None) -> Any:
    arrays = [np.asarray(_arrays._plain(a)) for a in arguments]
    if all(a.dtype != object for a in arrays):
        return plain(*arguments)
    result = np.frompyfunc(traced, len(arrays), 1)(*arrays)
    if name is not None:
        for index, value in np.ndenumerate(result):
            own = name if len(index) == 0 else f"{name}[{', '.join(map(str, index))}]"
            _core.traced_name(value, own)
    return _arrays.wrap(result)


def maximum(a: Any, b: Any, *more: Any, name: str | None = None) -> Any:
    """The largest of a, b and more, element by element; each pair is a site with the pieces "first" and "second".

    ``name`` names the site in pieces, tables and legends; elements of arrays are numbered.

    >>> import semismooth as ss
    >>> ss.maximum([1.0, -2.0], 0.0)
    array([1., 0.])
    """
    of_two = functools.partial(_kink, _arrays.maximum_of_two, np.maximum, name=name)
    return functools.reduce(lambda p, q: of_two((p, q)), (b, *more), a)


def minimum(a: Any, b: Any, *more: Any, name: str | None = None) -> Any:
    """The smallest of a, b and more, element by element; each pair is a site with the pieces "first" and "second"."""
    of_two = functools.partial(_kink, _arrays.minimum_of_two, np.minimum, name=name)
    return functools.reduce(lambda p, q: of_two((p, q)), (b, *more), a)


def clip(x: Any, lower: Any, upper: Any, *, name: str | None = None) -> Any:
    """The projection of x on [lower, upper], lower ≤ upper, element by element; each is a site with the pieces "lower", "interior", "upper"."""
    return _kink(_arrays.clip_of_one, np.clip, (x, lower, upper), name)


def where(condition: Any, a: Any, b: Any, *, name: str | None = None) -> Any:
    """a where the condition holds, else b, element by element; each comparison is a site with the pieces "first" and "second".

    The two formulas must agree where the sides of the comparison are equal: a map that jumps there is not piecewise smooth, and
    results are then wrong.

    >>> import semismooth as ss
    >>> huber = ss.trace(lambda x: [ss.where(x[0] < 1, x[0] ** 2, 2 * x[0] - 1)], 1)
    >>> huber([0.5]), huber([2.0])
    (array([0.25]), array([3.]))
    """
    return _kink(_core.traced_where, np.where, (condition, a, b), name)


def of_one(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The same function of an array with one entry."""
    return function if isinstance(function, _core.Map) else lambda x: [function(x[0])]


def of_two(function: Callable[[Any, Any], Any]) -> Callable[[Any], Any]:
    """The same function of an array with two entries."""
    return function if isinstance(function, _core.Map) else lambda x: [function(x[0], x[1])]
