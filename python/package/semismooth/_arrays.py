"""numpy on traced variables: arrays that hold them, and what numpy's functions do with them.

Users meet :class:`Traced` as the argument of a function that is traced. numpy hands every function with such an argument to
:func:`apply_ufunc` and :func:`apply_function` (its protocols ``__array_ufunc__`` and ``__array_function__``)."""

import functools
import operator
import sys
import threading
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from . import _core
from ._core import Condition, Expression

_state = threading.local()


def tracing() -> bool:
    """Whether this thread runs a function on traced variables."""
    return getattr(_state, "depth", 0) > 0


class Traced(np.ndarray):  # type: ignore[type-arg]
    """An array of traced variables, of what was computed from them, and of numbers."""

    # Above that of scipy's sparse matrices, which would take ``x @ A`` for themselves.
    __array_priority__ = 20.0

    def __array_ufunc__(self, ufunc: Any, method: Any, *inputs: Any, **options: Any) -> Any:
        return apply_ufunc(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        return apply_function(function, arguments, options)

    def __getitem__(self, key: Any) -> Any:
        if _has_conditions(key):
            raise TypeError(
                "x[x > 0] chooses entries by values, which traced variables do not have yet: write numpy.where(x > 0, x, 0), which keeps all"
            )
        return super().__getitem__(key)

    def __setitem__(self, key: Any, value: Any) -> None:
        if _has_conditions(key):
            key, value = ..., where(key, value, self.copy())
        super().__setitem__(key, value)

    def astype(self, dtype: Any, *args: Any, **options: Any) -> Any:
        """A copy: entries keep their type, as traced variables fit into no other."""
        return self.copy() if _fits(dtype) else super().astype(dtype, *args, **options)

    def dot(self, other: Any, out: Any = None) -> Any:
        return matmul(self, other)


def _fits(dtype: Any) -> bool:
    """Whether an array of this type may hold traced variables instead: real numbers, or anything."""
    try:
        return dtype is None or np.dtype(dtype).kind in "fO"
    except TypeError:
        return False


def _has_conditions(key: Any) -> bool:
    if isinstance(key, Condition):
        return True
    if isinstance(key, np.ndarray) and key.dtype == object:
        return any(isinstance(k, Condition) for k in key.flat)
    return False


def _is_traced(value: Any) -> bool:
    return isinstance(value, (Expression, Condition))


def holds_traced(value: Any) -> bool:
    """Whether a number, an array or nested lists hold traced variables."""
    if isinstance(value, np.ndarray):
        return value.dtype == object and any(map(_is_traced, value.flat))
    if isinstance(value, (list, tuple)):
        return any(map(holds_traced, value))
    return _is_traced(value)


def _plain(value: Any) -> Any:
    """What numpy's loops over objects take."""
    if isinstance(value, Traced):
        return value.view(np.ndarray)
    if _is_traced(value):
        cell = np.empty((), dtype=object)
        cell[()] = value
        return cell
    if isinstance(value, (list, tuple)) and holds_traced(value):
        return np.array(value, dtype=object)
    return value


def wrap(value: Any) -> Any:
    """Arrays of objects as arrays of traced variables, also inside tuples and lists."""
    if isinstance(value, np.ndarray) and value.dtype == object and not isinstance(value, Traced):
        return value[()] if value.ndim == 0 else value.view(Traced)
    if isinstance(value, (list, tuple)) and type(value) in (list, tuple):
        return type(value)(map(wrap, value))
    return value


def lifted(value: Any) -> Any:
    """The same with lists and arrays that hold traced variables as arrays of traced variables."""
    if isinstance(value, Traced) or _is_traced(value) or not holds_traced(value):
        return value
    if isinstance(value, np.ndarray):
        return value.view(Traced)
    if len({np.shape(v) for v in value}) > 1:
        # Parts of several shapes: the function may want them one by one.
        return type(value)(map(lifted, value))
    return np.array(value, dtype=object).view(Traced)


# Functions of one or two numbers or expressions.


def _number_or(method: str, plain: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def apply(a: Any) -> Any:
        if isinstance(a, Expression):
            return getattr(a, method)()
        if isinstance(a, Condition):
            raise TypeError(f"numpy.{plain.__name__} of a comparison of traced variables: write numpy.where(condition, a, b)")
        return plain(a)

    return apply


def _either(traced: Callable[..., Any], plain: Callable[..., Any]) -> Callable[..., Any]:
    def apply(*arguments: Any) -> Any:
        return traced(*arguments) if any(map(_is_traced, arguments)) else plain(*arguments)

    return apply


maximum_of_two = _either(_core.traced_maximum, np.maximum)
minimum_of_two = _either(_core.traced_minimum, np.minimum)
clip_of_one = _either(_core.traced_clip, np.clip)
_sqrt, _exp, _log = (_number_or(f, getattr(np, f)) for f in ("sqrt", "exp", "log"))
_log1p = _number_or("log1p", np.log1p)


def _sign(a: Any) -> Any:
    return _core.traced_where(a >= 0, 1.0, -1.0) if isinstance(a, Expression) else np.sign(a)


def _logaddexp(a: Any, b: Any) -> Any:
    # Both formulas are the same function; each overflows on the other side.
    d = a - b
    if not isinstance(d, Expression):
        return np.logaddexp(a, b)
    return _core.traced_where(d >= 0, a + _log1p(_exp(-d)), b + _log1p(_exp(d)))


def _arcsinh(a: Any) -> Any:
    size = abs(a)
    return _sign(a) * _log1p(size + size * size / (1 + _sqrt(size * size + 1)))


def _not(a: Any) -> Any:
    return ~a if isinstance(a, Condition) else not a


def _and(a: Any, b: Any) -> Any:
    return a & b if _is_traced(a) or _is_traced(b) else bool(a) and bool(b)


def _or(a: Any, b: Any) -> Any:
    return a | b if _is_traced(a) or _is_traced(b) else bool(a) or bool(b)


def _object_loop(function: Callable[..., Any], count: int, **identity: Any) -> Any:
    return np.frompyfunc(function, count, 1, **identity)


#: What a function does element by element. ``np.add`` and the like have loops over objects of their own.
_UFUNCS: dict[Any, Any] = {f: f for f in (np.add, np.subtract, np.multiply, np.divide, np.negative, np.positive, np.power, np.square)}
_UFUNCS |= {
    getattr(np, name): _object_loop(_number_or(name, getattr(np, name)), 1)
    for name in "sqrt exp log sin cos tan arctan sinh cosh tanh arcsin arccos log1p expm1 cbrt".split()
}
_UFUNCS |= {
    np.maximum: _object_loop(maximum_of_two, 2, identity=None),
    np.fmax: _object_loop(maximum_of_two, 2, identity=None),
    np.minimum: _object_loop(minimum_of_two, 2, identity=None),
    np.fmin: _object_loop(minimum_of_two, 2, identity=None),
    np.absolute: _object_loop(abs, 1),
    np.fabs: _object_loop(abs, 1),
    np.float_power: np.power,
    np.conjugate: _object_loop(lambda a: a, 1),
    np.sign: _object_loop(_sign, 1),
    np.copysign: _object_loop(lambda a, b: abs(a) * _sign(b), 2),
    np.heaviside: _object_loop(lambda a, at_zero: _core.traced_where(a >= 0, 1.0, 0.0), 2),
    np.reciprocal: _object_loop(lambda a: 1.0 / a, 1),
    np.hypot: _object_loop(lambda a, b: _sqrt(a * a + b * b), 2),
    np.arctan2: _object_loop(_either(_core.traced_arctan2, np.arctan2), 2),
    np.log2: _object_loop(lambda a: _log(a) / np.log(2.0), 1),
    np.log10: _object_loop(lambda a: _log(a) / np.log(10.0), 1),
    np.exp2: _object_loop(lambda a: _exp(a * np.log(2.0)), 1),
    np.arcsinh: _object_loop(_arcsinh, 1),
    np.arccosh: _object_loop(lambda a: _log(a + _sqrt((a - 1) * (a + 1))), 1),
    np.arctanh: _object_loop(lambda a: 0.5 * _log1p(2 * a / (1 - a)), 1),
    np.logaddexp: _object_loop(_logaddexp, 2),
    np.deg2rad: _object_loop(lambda a: a * (np.pi / 180), 1),
    np.radians: _object_loop(lambda a: a * (np.pi / 180), 1),
    np.rad2deg: _object_loop(lambda a: a * (180 / np.pi), 1),
    np.degrees: _object_loop(lambda a: a * (180 / np.pi), 1),
    np.greater: _object_loop(operator.gt, 2),
    np.greater_equal: _object_loop(operator.ge, 2),
    np.less: _object_loop(operator.lt, 2),
    np.less_equal: _object_loop(operator.le, 2),
    np.equal: _object_loop(operator.eq, 2),
    np.not_equal: _object_loop(operator.ne, 2),
    np.logical_and: _object_loop(_and, 2, identity=True),
    np.logical_or: _object_loop(_or, 2, identity=False),
    np.logical_not: _object_loop(_not, 1),
    np.bitwise_and: _object_loop(operator.and_, 2),
    np.bitwise_or: _object_loop(operator.or_, 2),
    np.invert: _object_loop(_not, 1),
}
# The method `clip` of arrays calls a function that has no public name.
_UFUNCS[(np._core if hasattr(np, "_core") else np.core).umath.clip] = _object_loop(clip_of_one, 3)  # type: ignore[attr-defined]

#: Functions that jump, so that a map made with them would not be continuous.
#: Those of scipy.special, by name, so that scipy need not be there.
_OF_SCIPY: dict[str, Any] = {
    "expit": _object_loop(lambda a: 0.5 + 0.5 * np.tanh(0.5 * a), 1),
    "logit": _object_loop(lambda a: _log(a / (1 - a)), 1),
}

_JUMPS = {np.floor, np.ceil, np.rint, np.trunc, np.remainder, np.fmod, np.floor_divide, np.modf}


def apply_ufunc(ufunc: Any, method: str, inputs: Iterable[Any], options: dict[str, Any]) -> Any:
    """``getattr(ufunc, method)(*inputs, **options)``, traced."""
    inputs = tuple(inputs)
    (out,) = options.pop("out", (None,)) or (None,)
    for name in ("dtype", "casting", "order", "subok", "signature"):
        options.pop(name, None)
    if options.pop("where", True) is not True:
        raise TypeError(f"numpy.{ufunc.__name__}(where=...) of traced variables: write numpy.where(condition, a, b)")
    if ufunc is np.matmul or ufunc is getattr(np, "vecdot", None):
        result = matmul(*inputs)
    else:
        result = _elementwise(ufunc, method, inputs, options)
    if out is None:
        return result
    if not isinstance(out, np.ndarray) or out.dtype != object:
        raise TypeError(
            "traced variables do not fit into an array of numbers: make it by numpy.zeros_like(x), or write F = F + x in place of F += x"
        )
    np.ndarray.__setitem__(out, ..., result)
    return out


def _elementwise(ufunc: Any, method: str, inputs: tuple[Any, ...], options: dict[str, Any]) -> Any:
    own = _UFUNCS.get(ufunc) or _OF_SCIPY.get(getattr(ufunc, "__name__", ""))
    if own is None and not any(holds_traced(a) for a in inputs):
        return getattr(ufunc, method)(*map(_numbers, inputs), **options)
    if own is None:
        name = getattr(ufunc, "__name__", str(ufunc))
        why = "jumps, and a piecewise-smooth map is continuous" if ufunc in _JUMPS else "cannot be traced"
        raise TypeError(f"{name} {why}. Give the derivative, jac=function or jac=\"differences\": the function is then called with numbers")
    if any(hasattr(a, "tocsr") for a in inputs):
        return NotImplemented
    plain = [_plain(a) for a in inputs]
    return wrap(getattr(own, method)(*plain, **options))


def _numbers(value: Any) -> Any:
    """Arrays without traced variables as arrays of numbers."""
    return np.array(value, dtype=float) if isinstance(value, Traced) else value


# Products.


def _rows(matrix: Any) -> tuple[Any, Any, Any]:
    """A matrix of numbers in compressed rows."""
    if hasattr(matrix, "tocsr"):
        csr = matrix.tocsr()
        return csr.indptr, csr.indices, csr.data
    rows, columns = matrix.shape
    return np.arange(rows + 1) * columns, np.tile(np.arange(columns), rows), matrix.ravel()


def _product(matrix: Any, x: Any) -> Any:
    """A matrix of numbers, which may be sparse, times a vector or a matrix of traced variables."""
    x = _plain(x)
    if matrix.shape[1] != x.shape[0]:
        raise ValueError(f"a matrix of shape {matrix.shape} times an array of shape {x.shape}")
    rows = _rows(matrix)
    columns = x.reshape(x.shape[0], -1).T
    found = np.empty((len(columns), matrix.shape[0]), dtype=object)
    for k, column in enumerate(columns):
        entries = column.tolist()
        found[k] = _core.traced_product(*rows, entries) if any(map(_is_traced, entries)) else matrix @ column.astype(float)
    return wrap(found.T.reshape((matrix.shape[0],) + x.shape[1:]))


def matmul(a: Any, b: Any, out: Any = None) -> Any:
    """``a @ b`` where one of them is traced; either may be sparse."""
    a, b = (m if hasattr(m, "tocsr") else lifted(m) for m in (a, b))
    if hasattr(b, "tocsr"):
        return _product(b.T, a) if np.ndim(a) == 1 else _product(b.T, np.asarray(a).T).T
    a, b = (m if hasattr(m, "tocsr") else np.asarray(_plain(m)) for m in (a, b))
    if not hasattr(a, "tocsr") and (a.ndim == 0 or b.ndim == 0):
        return wrap(np.multiply(a, b))
    left, right = (not hasattr(m, "tocsr") and holds_traced(m) for m in (a, b))
    if right and not left and a.ndim <= 2 and b.ndim <= 2:
        a = a if hasattr(a, "tocsr") else a.astype(float)
        result = _product(a if a.ndim == 2 else a[None, :], b)
        return result if a.ndim == 2 else result[0]
    if left and not right and a.ndim <= 2 and b.ndim <= 2:
        b = b.astype(float)
        result = _product(b.T if b.ndim == 2 else b[None, :], a.T)
        return result.T if b.ndim == 2 else result[0]
    return wrap(np.matmul(a, b))


# Other functions of numpy.


def where(condition: Any, *values: Any) -> Any:
    if len(values) != 2:
        raise TypeError("numpy.where of traced variables needs both values: where(condition, a, b)")
    return wrap(_object_loop(_core.traced_where, 3)(*(np.asarray(_plain(lifted(a)), dtype=object) for a in (condition, *values))))


def _clip(a: Any, a_min: Any = None, a_max: Any = None, out: Any = None, *, min: Any = None, max: Any = None, **options: Any) -> Any:
    lower, upper = a_min if min is None else min, a_max if max is None else max
    if lower is None and upper is None:
        return a
    if upper is None or np.all(np.equal(_number_array(upper), np.inf)):
        return a if lower is None else apply_ufunc(np.maximum, "__call__", (lifted(a), lifted(lower)), {"out": (out,)})
    if lower is None or np.all(np.equal(_number_array(lower), -np.inf)):
        return apply_ufunc(np.minimum, "__call__", (lifted(a), lifted(upper)), {"out": (out,)})
    plain = [_plain(lifted(v)) for v in (a, lower, upper)]
    result = wrap(_object_loop(clip_of_one, 3)(*plain))
    if out is None:
        return result
    out[...] = result
    return out


def _number_array(bound: Any) -> Any:
    """A bound that is compared with infinity; what is traced is not infinite."""
    return np.zeros(1) if holds_traced(bound) else np.asarray(bound, dtype=float)


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    x = np.asarray(_plain(lifted(x))).view(Traced)
    if axis is None and ord in (None, "fro"):
        x, axis = (x.ravel(), 0) if not keepdims else (x, tuple(range(x.ndim)))
    elif axis is None and x.ndim == 1:
        axis = 0
    if not isinstance(axis, (int, np.integer)) and not (isinstance(axis, tuple) and (len(axis) == 1 or ord in (None, "fro"))):
        raise TypeError(f"numpy.linalg.norm(ord={ord!r}) of matrices of traced variables: only the norm of Frobenius is known")
    if ord in (None, 2, "fro"):
        return np.sqrt(np.sum(x * x, axis=axis, keepdims=keepdims))
    size = np.abs(x)
    if ord in (np.inf, -np.inf):
        return (np.max if ord > 0 else np.min)(size, axis=axis, keepdims=keepdims)
    if ord == 1:
        return np.sum(size, axis=axis, keepdims=keepdims)
    return np.sum(size**ord, axis=axis, keepdims=keepdims) ** (1.0 / ord)


def _interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None) -> Any:
    """A ramp at each knot, the end knots included, where the slope changes."""
    knots = np.asarray(xp, dtype=float)
    if holds_traced(xp):
        raise TypeError("numpy.interp with traced knots: only the abscissae x and the values fp may be traced")
    values = lifted(fp) if holds_traced(fp) else np.asarray(fp, dtype=float)
    if knots.ndim != 1 or len(knots) == 0 or len(values) != len(knots):
        raise ValueError("numpy.interp needs as many values as knots, at least one")
    if period is not None:
        raise TypeError("numpy.interp(period=...) of traced variables is not known: repeat the knots over the range that is used")
    if not np.all(np.diff(knots) > 0):
        raise ValueError("numpy.interp needs increasing knots")
    for name, value, end in (("left", left, values[0]), ("right", right, values[-1])):
        if value is not None and (_is_traced(value) or _is_traced(end) or value != end):
            raise TypeError(f"numpy.interp({name}=...) makes a function that jumps at its end; a piecewise-smooth map is continuous")
    slopes = np.concatenate([[0.0], np.diff(values) / np.diff(knots), [0.0]])
    result = values[0]
    for knot, change in zip(knots, np.diff(slopes)):
        if _is_traced(change) or change != 0:
            result = result + change * np.maximum(x - knot if knot else x, 0.0)
    return result if np.ndim(x) == 0 or holds_traced(result) else np.full(np.shape(x), result)


def _select(condlist: Any, choicelist: Any, default: Any = 0) -> Any:
    result = default
    for condition, choice in zip(reversed(list(condlist)), reversed(list(choicelist))):
        result = where(condition, choice, result)
    return result


def _piecewise(x: Any, condlist: Any, funclist: Any, *args: Any, **options: Any) -> Any:
    conditions = [condlist] if isinstance(condlist, Condition) else list(condlist)
    values = [f(x, *args, **options) if callable(f) else f for f in funclist]
    result = values[len(conditions)] if len(values) > len(conditions) else 0.0
    for condition, value in zip(conditions, values):
        result = where(condition, value, result)
    return result


def _solve(a: Any, b: Any) -> Any:
    if holds_traced(a):
        raise TypeError("numpy.linalg.solve with a traced matrix: make its solution y unknowns, with the equations A(x) @ y - b")
    return matmul(np.linalg.inv(np.asarray(a, dtype=float)), b)


#: Numbers up to which they are sorted: each pair that changes places is a kink.
_SORTED = 16


def _sort(a: Any, axis: Any = -1, **options: Any) -> Any:
    """A network that compares neighbours: the smaller one goes first."""
    if axis is None:
        a, axis = np.ravel(a), 0
    rows = list(np.moveaxis(lifted(a), axis, 0))
    if len(rows) > _SORTED:
        raise TypeError(f"numpy.sort of more than {_SORTED} traced numbers, each pair a kink: is the maximum, or a sum of maxima, what is meant?")
    for last in range(len(rows) - 1, 0, -1):
        for k in range(last):
            rows[k], rows[k + 1] = np.minimum(rows[k], rows[k + 1]), np.maximum(rows[k], rows[k + 1])
    return np.moveaxis(np.stack([lifted(row) for row in rows]), 0, axis)


def _median(a: Any, axis: Any = None, **options: Any) -> Any:
    ordered = _sort(a, axis)
    middle = np.moveaxis(ordered, 0 if axis is None else axis, 0)
    n = len(middle)
    return (middle[(n - 1) // 2] + middle[n // 2]) / 2


def _block(arrays: Any) -> Any:
    """Innermost lists side by side, those around them below each other."""

    def depth(part: Any) -> int:
        return 1 + depth(part[0]) if isinstance(part, list) else 0

    levels = depth(arrays)
    parts = [arrays]
    for _ in range(levels):
        parts = [inner for part in parts for inner in part]
    most = max(levels, *(np.ndim(part) for part in parts))

    def joined(part: Any, level: int) -> Any:
        if not isinstance(part, list):
            return np.asarray(lifted(part)).view(Traced)[(np.newaxis,) * (most - np.ndim(part))]
        return np.concatenate([joined(inner, level + 1) for inner in part], axis=level - levels)

    return joined(arrays, 0)


def _by_values(name: str) -> Callable[..., Any]:
    def refuse(*arguments: Any, **options: Any) -> Any:
        raise TypeError(
            f"numpy.{name} chooses by values, which traced variables do not have yet: write max, min, where, clip of the numbers themselves"
        )

    return refuse


def _like(value: Any) -> Callable[..., Any]:
    def make(a: Any, *arguments: Any, dtype: Any = None, shape: Any = None, **options: Any) -> Any:
        fill = arguments[0] if value is None else value
        made = np.empty(np.shape(a) if shape is None else shape, dtype=object).view(Traced)
        made[...] = fill
        return made if _fits(dtype) else made.astype(dtype)

    return make


def _in_place(function: Any) -> Callable[..., Any]:
    return lambda *arguments, **options: function._implementation(*arguments, **options)


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.zeros_like: _like(0.0),
    np.empty_like: _like(0.0),
    np.ones_like: _like(1.0),
    np.full_like: _like(None),
    np.copyto: _in_place(np.copyto),
    np.fill_diagonal: _in_place(np.fill_diagonal),
    np.put: _in_place(np.put),
    np.where: where,
    np.clip: _clip,
    np.dot: matmul,
    np.inner: lambda a, b: matmul(a, np.transpose(b) if np.ndim(b) == 2 else b),
    np.vdot: lambda a, b: matmul(np.ravel(a), np.ravel(b)),
    np.linalg.norm: _norm,
    np.linalg.solve: _solve,
    np.interp: _interp,
    np.select: _select,
    np.piecewise: _piecewise,
    np.real: lambda val: val,
    # Traced numbers are never missing.
    np.nanmax: lambda a, *more, **options: np.max(lifted(a), *more, **options),
    np.nanmin: lambda a, *more, **options: np.min(lifted(a), *more, **options),
    np.nansum: lambda a, *more, **options: np.sum(lifted(a), *more, **options),
    np.nanmean: lambda a, *more, **options: np.mean(lifted(a), *more, **options),
    np.sort: _sort,
    np.median: _median,
    np.block: _block,
    np.argmax: _by_values("argmax"),
    np.argmin: _by_values("argmin"),
    np.argsort: _by_values("argsort"),
    np.searchsorted: _by_values("searchsorted"),
    np.nonzero: _by_values("nonzero"),
    np.fix: None,  # type: ignore[dict-item]
    np.round: None,  # type: ignore[dict-item]
}


def apply_function(function: Any, arguments: Any, options: dict[str, Any]) -> Any:
    """``function(*arguments, **options)``, traced: by a function of this module, else by that of numpy on arrays of objects."""
    name = f"numpy.{getattr(function, '__name__', function)}"
    if function in _FUNCTIONS:
        own = _FUNCTIONS[function]
        if own is None:
            raise TypeError(f"{name} jumps, and a piecewise-smooth map is continuous")
        return own(*arguments, **options)
    if not any(map(holds_traced, (*arguments, *options.values()))):
        arguments = map(_numbers, arguments)
        return function(*arguments, **{key: _numbers(value) for key, value in options.items()})
    try:
        return wrap(function._implementation(*arguments, **options))
    except TypeError as error:
        if "traced" in str(error):
            raise
        raise TypeError(
            f"{name} of traced variables is not known ({error}). Write it with sums, products and functions of single numbers; or give the "
            "derivative, jac=function or jac=\"differences\": the function is then called with numbers"
        ) from error


# Runs of a function.


def _teach_scipy() -> None:
    """``A @ x`` of a sparse matrix of scipy refuses arrays of objects: it gets a look at traced ones first."""
    base = getattr(sys.modules.get("scipy.sparse._base"), "_spbase", None)
    name = "_matmul_dispatch" if hasattr(base, "_matmul_dispatch") else "_mul_dispatch"
    original = getattr(base, name, None)
    if original is None or hasattr(original, "semismooth"):
        return

    @functools.wraps(original)
    def dispatch(self: Any, other: Any) -> Any:
        traced = isinstance(other, Traced) or (tracing() and isinstance(other, np.ndarray) and holds_traced(other))
        return matmul(self, other) if traced else original(self, other)

    dispatch.semismooth = True  # type: ignore[attr-defined]
    setattr(base, name, dispatch)


def run(function: Callable[..., Any], variables: list[Any], unknowns: int | None = None) -> list[Any]:
    """The values of a function of these variables, in one list; with a number of unknowns, of two arrays: these and the others."""
    from .numpy import in_place_of_numpy

    x = np.empty(len(variables), dtype=object)
    x[:] = variables
    _teach_scipy()
    _state.depth = getattr(_state, "depth", 0) + 1
    try:
        with in_place_of_numpy(function):
            view = x.view(Traced)
            values = function(view) if unknowns is None else function(view[:unknowns], view[unknowns:])
        flat = np.asarray(_flat(values), dtype=object).ravel()
    finally:
        _state.depth -= 1
    return list(flat)


def _flat(values: Any) -> Any:
    """Arrays of several lengths in a list, one after another."""
    if isinstance(values, (list, tuple)) and len({np.shape(v) for v in values}) > 1:
        return np.concatenate([np.ravel(np.asarray(_plain(v), dtype=object)) for v in values])
    return _plain(values)


#: Variables up to which the number of a function is sought.
_MOST = 64


def with_own_variables(function: Any, parametric: bool = False) -> Any:
    """A function traced on as many variables as it has values, or one more where that is no number of its values, or where it is to have a
    parameter."""
    if not callable(function):
        raise TypeError("all_solutions takes a function, a Map, an Lcp or a ContactProblem")
    found: dict[int, list[Any]] = {0: [], 1: []}
    refused: BaseException | None = None
    for n in range(1, _MOST + 1):
        try:
            traced = _core.trace(function, n)
        except (IndexError, TypeError, ValueError) as error:
            # A sentence on what cannot be traced tells more than one on a wrong number of variables.
            refused = error if refused is None or "traced" in str(error) else refused
            continue
        kind = n - traced.num_residuals
        if kind in found:
            found[kind].append(traced)
        if len(found[1] if parametric else found[0]) > 1:
            break
    fitting = found[1] if parametric else found[0] or found[1]
    if len(fitting) == 1:
        return fitting[0]
    if not fitting and refused is not None and "traced" in str(refused):
        raise refused
    why = "fits several numbers of variables" if fitting else f"fits no number of variables up to {_MOST}"
    raise ValueError(f"the function {why}: write {'trace(H, num_vars)' if parametric else 'all_solutions(H, num_vars=...)'}") from refused


def solutions_at_sections(problem: Any, parameter_range: tuple[float, float] | None, sections: list[float] | None) -> tuple[Any, Any]:
    """The problem, traced, and its solutions at some parameters, where a diagram begins."""
    if not isinstance(problem, (_core.Map, _core.ContactProblem)):
        problem = with_own_variables(problem, parametric=True)
    if sections is None:
        if parameter_range is None or not np.all(np.isfinite(parameter_range)):
            raise ValueError("a diagram needs starts, or sections (parameters at which they are sought), or a finite parameter_range")
        sections = [parameter_range[0], sum(parameter_range) / 2, parameter_range[1]]
    points = [point for parameter in sections for point in _core.all_solutions(problem, parameter).points]
    if not points:
        raise ValueError(f"no solution was found at the parameters {sections}: give starts or other sections")
    return problem, points
