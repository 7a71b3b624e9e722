"""numpy for functions that are traced: ``import semismooth.numpy as np`` in place of ``import numpy as np``.

Everything is numpy's. While a function runs on traced variables (:func:`semismooth.trace` and all functions that trace), arrays made by
``zeros``, ``ones``, ``empty``, ``full``, ``array`` and ``asarray`` can hold these, and lists of them are arguments like arrays. The same
happens to the names ``np``, ``math``, ``max``, ``min`` of the module of the function for the time of the trace, so that this module need
not be imported for functions that use their module's numpy.
"""

import builtins
import contextlib
import functools
import math as _math
import sys
import threading
import types
from collections.abc import Callable, Iterator
from typing import Any

import numpy as _numpy

from ._arrays import Traced, _fits, apply_function, apply_ufunc, holds_traced, lifted, tracing, wrap

__all__: list[str] = []


def _holding(made: Any) -> Any:
    """An array of numbers that can hold traced variables."""
    return made.astype(object).view(Traced) if made.dtype.kind in "fO" else made


def _creating(make: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(make)
    def create(*arguments: Any, **options: Any) -> Any:
        if not tracing():
            return make(*arguments, **options)
        if holds_traced(arguments[1:]):
            options["dtype"] = object
        return _holding(make(*arguments, **options))

    return create


def _converting(make: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(make)
    def convert(object: Any, dtype: Any = None, *arguments: Any, **options: Any) -> Any:
        if tracing() and _fits(dtype) and (isinstance(object, Traced) or holds_traced(object)):
            return wrap(make(object, builtins.object, *arguments, **options))
        return make(object, dtype, *arguments, **options)

    return convert


#: The functions below, each made once.
_LIFTED: dict[Any, Callable[..., Any]] = {
    # Of nested lists the nesting matters, which arrays of them do not have.
    _numpy.block: lambda arrays: apply_function(_numpy.block, (arrays,), {}) if tracing() else _numpy.block(arrays)
}


def _lifting(function: Callable[..., Any]) -> Callable[..., Any]:
    if function in _LIFTED:
        return _LIFTED[function]

    @functools.wraps(function)
    def apply(*arguments: Any, **options: Any) -> Any:
        if not tracing():
            return function(*arguments, **options)
        return wrap(function(*map(lifted, arguments), **{key: lifted(value) for key, value in options.items()}))

    if isinstance(function, _numpy.ufunc):
        for method in ("reduce", "accumulate", "reduceat", "outer"):
            setattr(apply, method, _lifting(getattr(function, method)))
        apply.at = function.at  # type: ignore[attr-defined]
    _LIFTED[function] = apply
    return apply


_MADE: dict[Any, Callable[..., Any]] = {f: _creating(f) for f in (_numpy.zeros, _numpy.ones, _numpy.empty, _numpy.full)}
_MADE |= {f: _converting(f) for f in (_numpy.array, _numpy.asarray, _numpy.asanyarray, _numpy.ascontiguousarray)}


def _replaced(value: Any) -> Any:
    """A function of numpy that can be traced as well; other things unchanged."""
    if isinstance(value, (types.BuiltinFunctionType, types.FunctionType)) and value in _MADE:
        return _MADE[value]
    if isinstance(value, _numpy.ufunc) or (type(value) is type(_numpy.sum) and hasattr(value, "_implementation")):
        return _lifting(value)
    return value


class _Module:
    """numpy's functions that can be traced as well, under their names."""

    def __init__(self, module: types.ModuleType) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._module, name)
        if isinstance(value, types.ModuleType):
            return _LINALG if value is _numpy.linalg else value
        return _replaced(value) if tracing() and callable(value) and not isinstance(value, type) else value

    def __dir__(self) -> list[str]:
        return dir(self._module)


class _Math(_Module):
    """The functions of ``math``, those of numpy for traced variables."""

    _NAMES = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "pow": "power", "asinh": "arcsinh"}
    _NAMES |= {"acosh": "arccosh", "atanh": "arctanh", "dist": "", "fmod": "remainder"}

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._module, name)
        other = getattr(_numpy, self._NAMES.get(name, name), None)
        if not callable(value) or not callable(other):
            return value

        @functools.wraps(value)
        def apply(*arguments: Any) -> Any:
            if not any(map(holds_traced, arguments)):
                return value(*arguments)
            if name == "log" and len(arguments) == 2:
                return _numpy.log(arguments[0]) / _numpy.log(arguments[1])
            return other(*arguments)

        return apply


_LINALG = _Module(_numpy.linalg)
_NUMPY = _Module(_numpy)
_MATH = _Math(_math)


def _largest(ufunc: Any, builtin: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(builtin)
    def apply(*arguments: Any, **options: Any) -> Any:
        if options or not tracing() or not holds_traced(arguments):
            return builtin(*arguments, **options)
        values = list(arguments[0]) if len(arguments) == 1 else list(arguments)
        return functools.reduce(lambda a, b: apply_ufunc(ufunc, "__call__", (a, b), {}), values)

    return apply


_BUILTINS = {"max": _largest(_numpy.maximum, max), "min": _largest(_numpy.minimum, min)}


def __getattr__(name: str) -> Any:
    return getattr(_NUMPY, name)


def __dir__() -> list[str]:
    return dir(_numpy)


# What the globals of a function name, while it is traced.

_lock = threading.Lock()
#: The dictionaries of modules that are changed, by identity: how many runs need it, and what to put back.
_changed: dict[int, tuple[int, dict[str, Any]]] = {}


def _substitute(value: Any) -> Any:
    if isinstance(value, types.ModuleType):
        return {_numpy: _NUMPY, _numpy.linalg: _LINALG, _math: _MATH}.get(value, value)
    if isinstance(value, types.BuiltinFunctionType) and getattr(value, "__module__", None) == "math":
        return getattr(_MATH, value.__name__)
    return _replaced(value)


def _functions(function: Any) -> Iterator[types.FunctionType]:
    """Python functions that a callable is made of, and those that these name, as far as they are of the user."""
    waiting, seen = [function], set()
    while waiting:
        found = waiting.pop()
        if isinstance(found, functools.partial):
            waiting += [found.func, *found.args]
            continue
        found = getattr(found, "__func__", found)
        if not isinstance(found, types.FunctionType):
            found = getattr(type(found), "__call__", None)
        if not isinstance(found, types.FunctionType) or found in seen:
            continue
        seen.add(found)
        if found.__module__ and found.__module__.partition(".")[0] in ("numpy", "scipy", "semismooth"):
            continue
        yield found
        waiting.append(getattr(found, "__wrapped__", None))
        for cell in found.__closure__ or ():
            with contextlib.suppress(ValueError):
                waiting.append(cell.cell_contents)
        waiting += [found.__globals__[name] for name in found.__code__.co_names if name in found.__globals__]


@contextlib.contextmanager
def in_place_of_numpy(function: Any) -> Iterator[None]:
    """The globals of a function with numpy, ``math``, ``max`` and ``min`` that can be traced, for a while."""
    dictionaries = {id(f.__globals__): f.__globals__ for f in _functions(function)}
    with _lock:
        for key, names in dictionaries.items():
            count, saved = _changed.get(key, (0, {}))
            if count == 0:
                replaced = {name: (value, _substitute(value)) for name, value in list(names.items())}
                saved = {name: value for name, (value, new) in replaced.items() if new is not value}
                names.update({name: replaced[name][1] for name in saved})
                for name in _BUILTINS.keys() - names.keys():
                    names[name], saved[name] = _BUILTINS[name], _MISSING
            _changed[key] = count + 1, saved
    try:
        yield
    finally:
        with _lock:
            for key, names in dictionaries.items():
                count, saved = _changed.pop(key)
                if count > 1:
                    _changed[key] = count - 1, saved
                    continue
                for name, value in saved.items():
                    if value is _MISSING:
                        names.pop(name, None)
                    else:
                        names[name] = value


_MISSING = object()
