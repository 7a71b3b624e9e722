"""Matrices of bodies in files of other programs."""

from os import PathLike, fspath
from typing import Any, NamedTuple

import numpy as np

from . import _core


class Substructure(NamedTuple):
    """The stiffness of a substructure on the displacements that it retains, as :func:`read_substructure` reads it."""

    stiffness: Any
    """scipy.sparse.csc_matrix of shape (n, n)."""
    nodes: np.ndarray
    """Label of the node of each displacement, shape (n,)."""
    components: np.ndarray
    """Component of each displacement, shape (n,): 0, 1, 2, and 3, 4, 5 for rotations."""


def read_substructure(path: str | PathLike[str]) -> Substructure:
    """Reads the stiffness from the ``.mtx`` file that Abaqus and CalculiX write under ``*SUBSTRUCTURE MATRIX OUTPUT``. scipy must be
    installed.

    Raises
    ------
    SemismoothError
        If the file cannot be read, is of another kind, or its numbers of nodes, components and entries do not agree.
    """
    from scipy import sparse

    (data, indices, starts), places = _core._read_substructure(fspath(path))
    n = len(places)
    stiffness = sparse.csc_matrix((data, indices, starts), shape=(n, n))
    return Substructure(stiffness, places[:, 0], places[:, 1] - 1)


def read_op4(path: str | PathLike[str]) -> dict[str, Any]:
    """Reads the matrices of an OUTPUT4 file of Nastran by their names, with pyNastran, which must be installed: arrays, or matrices of
    scipy.sparse.

    Raises
    ------
    ImportError
        If pyNastran is not installed.
    """
    try:
        from pyNastran.op4.op4 import read_op4 as read
    except ImportError as error:
        raise ImportError(f"to read {fspath(path)}, install pyNastran: pip install pyNastran") from error
    # Versions up to 1.3 give pairs of a form and an array, later ones objects.
    return {name: found[1] if isinstance(found, tuple) else found.data for name, found in read(fspath(path), debug=False).items()}
