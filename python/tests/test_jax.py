"""Solutions as functions in jax."""

import numpy as np
import pytest
import semismooth as ss

jax = pytest.importorskip("jax")
jnp = jax.numpy

from semismooth.jax import solution  # noqa: E402


@pytest.fixture(params=[False, True], ids=["float32", "float64"])
def rounding(request):
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", request.param)
    yield 1e-12 if request.param else 1e-5
    jax.config.update("jax_enable_x64", before)


def root(x, p):
    return [x[0] ** 2 - p[0], x[1] - p[1] * x[0]]


def test_jit_grad_jvp_and_vmap_are_those_of_the_formula(rounding):
    x = solution(root, [1.0, 1.0], lower=[0.0, -np.inf])
    f = lambda p: jnp.sum(x(p) ** 2)  # p₀ + p₁² p₀
    p = jnp.array([4.0, 3.0])
    assert x(p).dtype == p.dtype
    np.testing.assert_allclose(x(p), [2.0, 6.0], rtol=rounding)
    np.testing.assert_allclose(jax.jit(jax.grad(f))(p), [10.0, 24.0], rtol=rounding)
    np.testing.assert_allclose(jax.jacobian(x)(p), [[0.25, 0.0], [0.75, 2.0]], atol=rounding)
    _, rate = jax.jvp(x, (p,), (jnp.array([1.0, -1.0]),))
    np.testing.assert_allclose(rate, [0.25, -1.25], rtol=rounding)
    many = jnp.array([[1.0, 2.0], [4.0, 3.0], [9.0, -1.0]])
    np.testing.assert_allclose(jax.vmap(x)(many), [[1.0, 2.0], [2.0, 6.0], [3.0, -3.0]], rtol=rounding)
    np.testing.assert_allclose(jax.vmap(jax.grad(f))(many)[:, 1], [4.0, 24.0, -18.0], rtol=rounding)


def test_kinks_have_an_element_and_failures_are_errors():
    x = solution(lambda x, p: x - p, [0.5], lower=0.0)
    assert float(jax.grad(lambda p: x(p)[0])(0.0)) in (0.0, 1.0)
    assert float(jax.grad(lambda p: x(p)[0])(-1.0)) == 0.0
    with pytest.raises(Exception, match="no solution"):
        solution(lambda x, p: x**2 + p, [1.0])(1.0).block_until_ready()
    assert issubclass(ss.SemismoothError, ValueError)
