"""Results as data: pickles, copies, files."""

import copyreg
import json
import os
from collections.abc import Callable
from typing import Any

import numpy as np

from . import _core

_CLASSES: dict[str, Any] = {name: getattr(_core, name) for name in _core._saved_classes()}

#: The first entry of every file, and the version of what follows.
_FORMAT = "semismooth"
_VERSION = 1


def _reduce(result: Any) -> tuple[Callable[..., Any], tuple[str, dict[str, Any]]]:
    return _core._restored, (type(result).__name__, _core._state(result))


for _class in _CLASSES.values():
    copyreg.pickle(_class, _reduce)


def _encoded(value: Any) -> Any:
    name = type(value).__name__
    if _CLASSES.get(name) is type(value):
        return {"class": name, "state": {key: _encoded(v) for key, v in _core._state(value).items()}}
    if isinstance(value, np.ndarray):
        # JSON has no complex numbers.
        flat = value.ravel().view(np.float64) if value.dtype == np.complex128 else value
        return {"array": flat.tolist(), "shape": list(value.shape), "type": value.dtype.str}
    if hasattr(value, "tocsc"):
        csc = value.tocsc()
        return {"sparse": [_encoded(part) for part in (csc.data, csc.indices, csc.indptr)], "shape": list(csc.shape)}
    if isinstance(value, tuple):
        return {"tuple": [_encoded(v) for v in value]}
    if isinstance(value, list):
        return [_encoded(v) for v in value]
    if isinstance(value, dict):
        if all(isinstance(key, str) for key in value):
            return {"dict": {key: _encoded(v) for key, v in value.items()}}
        # The names of JSON are texts; those of members are numbers.
        return {"pairs": [[_encoded(key), _encoded(v)] for key, v in value.items()]}
    if isinstance(value, (str, int, float, bool, type(None))):
        return value
    raise TypeError(f"a {name} cannot be saved in a file: use pickle")


def _decoded(value: Any) -> Any:
    if isinstance(value, list):
        return [_decoded(v) for v in value]
    if not isinstance(value, dict):
        return value
    if "class" in value:
        return _core._restored(value["class"], {key: _decoded(v) for key, v in value["state"].items()})
    if "array" in value:
        kind = np.dtype(value["type"])
        if kind.hasobject:
            raise ValueError("an array of objects in a saved file")
        own = np.float64 if kind == np.complex128 else kind
        return np.array(value["array"], dtype=own).view(kind).reshape(value["shape"])
    if "sparse" in value:
        from scipy.sparse import csc_matrix

        return csc_matrix(tuple(_decoded(part) for part in value["sparse"]), shape=value["shape"])
    if "tuple" in value:
        return tuple(_decoded(v) for v in value["tuple"])
    if "pairs" in value:
        return {_decoded(key): _decoded(v) for key, v in value["pairs"]}
    return {key: _decoded(v) for key, v in value["dict"].items()}


def save(result: Any, path: "str | os.PathLike[str]") -> None:
    """Writes a result (of ``solve`` and its relatives, lists, branches, diagrams, maps, meshes) to a file, which :func:`load` reads.

    The file is text in JSON: "format": "semismooth", "version": 1, "made by": the version of the package, and "content", in which numbers have
    all their digits. It holds no code, unlike a pickle.

    >>> import semismooth as ss, tempfile, os
    >>> path = os.path.join(tempfile.mkdtemp(), "result.json")
    >>> ss.save(ss.solve(lambda x: abs(x) + 2 * x - 3, 0.0), path)
    >>> ss.load(path).x
    array([1.])
    """
    if type(result) not in _CLASSES.values():
        raise TypeError(f"a {type(result).__name__} cannot be saved; these can: {', '.join(sorted(_CLASSES))}")
    whole = {"format": _FORMAT, "version": _VERSION, "made by": _core.__version__, "content": _encoded(result)}
    text = json.dumps(whole)
    # Whole or not at all, also where the program is ended meanwhile.
    beside = f"{os.fspath(path)}.{os.getpid()}.part"
    with open(beside, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(beside, path)


def load(path: "str | os.PathLike[str]") -> Any:
    """Reads what :func:`save` has written.

    Raises ``ValueError`` where the file is no such file, is of a later version, or refers to what it does not have.
    """
    with open(path, encoding="utf-8") as file:
        try:
            whole = json.load(file)
        except ValueError as error:
            raise ValueError(f"{os.fspath(path)} is no file of semismooth: {error}") from error
    if not isinstance(whole, dict) or whole.get("format") != _FORMAT:
        raise ValueError(f"{os.fspath(path)} is no file of semismooth")
    if whole.get("version") != _VERSION:
        raise ValueError(f"{os.fspath(path)} has version {whole.get('version')} of the format; this package reads version {_VERSION}")
    try:
        return _decoded(whole["content"])
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(f"{os.fspath(path)} is damaged: {error}") from error
