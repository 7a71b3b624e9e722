"""Friction problems in the format of fclib."""

from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from . import _core


class FrictionProblem(NamedTuple):
    """u = M r + q with Coulomb friction at each contact, as :func:`read_fclib` reads it: ``solve_friction(*problem[:3])``."""

    M: Any
    """scipy.sparse.csc_matrix of shape (n d, n d)."""
    q: np.ndarray
    """Shape (n d,)."""
    mu: np.ndarray
    """Coefficients of friction, shape (n,)."""
    dimension: int
    """d, 2 or 3."""
    solution: tuple[np.ndarray, np.ndarray] | None
    """Velocities u and reactions r, shape (n, d) both, where the file has a solution."""


def read_fclib(path: str | PathLike[str]) -> FrictionProblem:
    """Reads a local frictional contact problem of an HDF5 file of fclib (Acary, Brémond, Koziara, Pérignon 2014).

    The file's W, q and mu are M, q and mu of :func:`solve_friction`, contact by contact N, T1[, T2]. W may be stored by columns, by rows or
    as triplets. Problems with equality constraints besides contact (V, R, s) and global problems (``fclib_global``) are refused. h5py and
    scipy must be installed.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    FrictionProblem

    Raises
    ------
    SemismoothError
        If the file has no local problem, or one of another kind.
    """
    import h5py
    from scipy import sparse

    with h5py.File(path, "r") as file:
        if "fclib_local" not in file:
            raise _core.SemismoothError(f"{path}: there is no group fclib_local, hence no local problem")
        local = file["fclib_local"]
        if "V" in local or "R" in local:
            raise _core.SemismoothError(f"{path}: the problem has equality constraints (V, R, s) beside contact")
        group, vectors = local["W"], local["vectors"]
        if group.attrs.get("symmetric_packed"):
            raise _core.SemismoothError(f"{path}: W is one triangle of a symmetric matrix; store all of it")
        rows, columns, kind = (int(np.ravel(group[k][()])[0]) for k in ("m", "n", "nz"))
        p, i, x = (np.ravel(group[k][()]) for k in ("p", "i", "x"))
        d = int(np.ravel(local["spacedim"][()])[0])
        q, mu = np.ravel(vectors["q"][()]), np.ravel(vectors["mu"][()])
        found = file.get("solution")
        solution = None if found is None else (np.reshape(found["u"][()], (-1, d)), np.reshape(found["r"][()], (-1, d)))
    if (rows, columns) != (len(q), len(q)) or d * len(mu) != len(q):
        raise _core.SemismoothError(
            f"{path}: W has shape ({rows}, {columns}), q length {len(q)}, mu length {len(mu)} in dimension {d}: they do not fit"
        )
    if kind == -1:
        matrix = sparse.csc_matrix((x[: p[-1]], i[: p[-1]], p), shape=(rows, columns))
    elif kind == -2:
        matrix = sparse.csr_matrix((x[: p[-1]], i[: p[-1]], p), shape=(rows, columns)).tocsc()
    elif kind >= 0:
        # As in CSparse: p are columns, i rows.
        matrix = sparse.coo_matrix((x[:kind], (i[:kind], p[:kind])), shape=(rows, columns)).tocsc()
    else:
        raise _core.SemismoothError(f"{path}: W is stored in a way that is not known (nz = {kind})")
    return FrictionProblem(matrix, q, mu, d, solution)
