"""Functions of solutions, minimised over parameters."""

import numpy as np
import pytest
import semismooth as ss


def conditions(x, y):
    return [
        (1 + 0.2 * y) * x[0] - (3 + 1.333 * y) - 0.333 * x[2] + 2 * x[0] * x[3],
        (1 + 0.1 * y) * x[1] - y + x[2] + 2 * x[1] * x[3],
        0.333 * x[0] - x[1] + 1 - 0.1 * y,
        9 + 0.1 * y - x[0] ** 2 - x[1] ** 2,
    ]


@pytest.mark.parametrize("start", [0.0, 5.0, 10.0])
def test_outrata31_of_macmpec(start):
    found = ss.minimise(
        lambda x, p: ((x[0] - 3) ** 2 + (x[1] - 4) ** 2) / 2,
        lambda x, p: conditions(x, p[0]),
        np.ones(4),
        start,
        0.0,
        p_lower=0,
        p_upper=10,
    )
    assert found.solved and found.status == "solved" and found.message.startswith("stationary in the sense of Clarke")
    assert found.value == pytest.approx(3.2077, abs=5e-5)
    assert found.subgradient_norm <= 1e-6 * found.gradient_norm
    x = ss.solve_mcp(lambda x, p: conditions(x, p[0]), 0, np.inf, np.ones(4), params=found.params).x
    np.testing.assert_allclose(found.x, x, atol=1e-8)


def test_constraints_and_their_multipliers():
    # x = p; ½ ‖p − (2, 1)‖² over p₀ + p₁ = 1, p₀ ≤ ½: p = (½, ½), and p − (2, 1) + μ (1, 1) + ρ (1, 0) = 0.
    found = ss.minimise(
        lambda x, p: ((x[0] - 2) ** 2 + (x[1] - 1) ** 2) / 2,
        lambda x, p: x - p,
        np.zeros(2),
        [0.0, 0.0],
        p_upper=[0.5, np.inf],
        E=[[1.0, 1.0]],
        d=[1.0],
    )
    assert found.solved
    np.testing.assert_allclose(found.params, [0.5, 0.5], atol=1e-9)
    np.testing.assert_allclose(found.multipliers["equations"], [0.5], atol=1e-5)
    np.testing.assert_allclose(found.multipliers["upper"], [1.0, 0.0], atol=1e-5)


def test_a_run_can_be_stopped_and_limited():
    def run(**options):
        return ss.minimise(
            lambda x, p: abs(x[0] - 1) + (p[0] - 3) ** 2, lambda x, p: x - np.maximum(p, 0), 0.0, -2.0, **options
        )

    seen = []
    stopped = run(callback=lambda line: seen.append(line["value"]) or len(seen) == 2)
    assert stopped.status == "interrupted" and not stopped.solved and len(seen) == 2
    assert run(max_iterations=1).status == "iteration limit"
    whole = run()
    assert whole.solved and whole.history[-1]["step"] == "None" and "stationary" in repr(whole)
    # p = 2.5: beyond p = 1 the slopes are 1 and 2 (p − 3).
    assert whole.params == pytest.approx([2.5], abs=1e-4)


def test_a_limit_of_time_ends_within_a_solve():
    # The first solve alone has no end.
    with pytest.raises(ss.SemismoothError, match="limit of time|time"):
        ss.minimise(lambda x, p: x[0], lambda x, p: np.exp(x) + np.roll(x, 1) ** 2 + p, np.zeros(50), 1.0, max_time=1e-9)


def test_bad_input():
    def run(f=lambda x, p: x[0], F=lambda x, p: x - p, x0=0.0, p0=0.0, **options):
        return ss.minimise(f, F, x0, p0, **options)

    with pytest.raises(ValueError, match="f must give 1 values; it gives 2"):
        run(f=lambda x, p: [x[0], x[0]])
    with pytest.raises(ValueError, match="F must give 1 values; it gives 2"):
        run(F=lambda x, p: [x[0], x[0]])
    with pytest.raises(ss.SemismoothError, match="contradict"):
        run(p_lower=1.0, p_upper=-1.0)
    with pytest.raises(ss.SemismoothError, match="at the start"):
        run(F=lambda x, p: 0 * x + p + 1)
    with pytest.raises(ss.SemismoothError, match="tolerance"):
        run(tolerance=-1.0)
    with pytest.raises(TypeError, match="steps"):
        run(steps=3)
