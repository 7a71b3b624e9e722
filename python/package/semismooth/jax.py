"""Solutions of equations and complementarity problems as functions in jax, which pass ``jit``, ``grad``, ``jvp`` and ``vmap``. Needs jax.

>>> import jax, semismooth.jax
>>> x = semismooth.jax.solution(lambda x, p: x**2 - p, [1.0], lower=0.0)
>>> float(jax.grad(lambda p: x(p)[0])(4.0))
0.25
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ._core import SemismoothError, solve, solve_mcp

__all__ = ["solution"]


def solution(
    F: Callable[[Any, Any], Any],
    x0: ArrayLike,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    **options: Any,
) -> Callable[[jax.Array], jax.Array]:
    """The solution x, shape (n,), of F(x, p) = 0, or with bounds of the mixed complementarity problem, as a function of p, shape (k,) or a
    number.

    F is written for numpy and traced by semismooth, not by jax: see :func:`semismooth.trace`. ``x0`` is the start, ``options`` are those of
    :func:`semismooth.solve_mcp`. Solutions are computed on the host, in float64 whatever the type of p is, and rounded to that type; the
    elements of a ``vmap`` one after the other.

    Derivatives are products with the matrix (n, k) of :meth:`semismooth.Sensitivity.element`, one solve for each parameter: the derivative where
    there is one, at a kink the lexicographic derivative along the unit vectors, an element of the generalised derivative. A problem that is not
    solved, and derivatives where the solutions are not known to be one function of p, raise ``SemismoothError``, which jax passes on as an
    error of a callback.
    """
    start = np.atleast_1d(np.asarray(x0, dtype=np.float64))
    n = start.size

    def solved(p: Any) -> Any:
        params = np.asarray(p, dtype=np.float64)
        if lower is None and upper is None:
            result = solve(F, start, params=params, **options)
        else:
            result = solve_mcp(F, lower, upper, start, params=params, **options)
        if result.sensitivity is None:
            raise SemismoothError(f"no solution at p = {params}: {result.message}")
        return result

    def value(p: Any) -> Any:
        return solved(p).x.astype(p.dtype)

    def value_and_matrix(p: Any) -> Any:
        result = solved(p)
        return result.x.astype(p.dtype), result.sensitivity.element().astype(p.dtype)

    @jax.custom_jvp
    def of_vector(p: jax.Array) -> jax.Array:
        return jax.pure_callback(value, jax.ShapeDtypeStruct((n,), p.dtype), p, vmap_method="sequential")

    @of_vector.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        (p,), (dp,) = primals, tangents
        shapes = jax.ShapeDtypeStruct((n,), p.dtype), jax.ShapeDtypeStruct((n, p.size), p.dtype)
        x, matrix = jax.pure_callback(value_and_matrix, shapes, p, vmap_method="sequential")
        return x, matrix @ dp

    def x(p: Any) -> jax.Array:
        p = jnp.asarray(p)
        if not jnp.issubdtype(p.dtype, jnp.floating):
            p = p.astype(jnp.result_type(float))
        return of_vector(p.reshape(-1))

    return x
