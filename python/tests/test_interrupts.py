"""Ctrl-C ends long runs of every kind, each of which would take hours."""

import os
import signal
import threading

import numpy as np
import pytest
import semismooth as ss


def many_solutions():
    rng = np.random.default_rng(1)
    m = rng.normal(size=(40, 40))
    lcp = ss.Lcp(m - m.T / 2 - 2 * np.eye(40), rng.normal(size=40))
    ss.all_solutions(lcp, max_nodes=10**12)


def restarts():
    ss.solve_mcp(
        lambda x: np.exp(x) + np.roll(x, 1) ** 2 + 1,
        -np.inf,
        np.inf,
        np.zeros(100),
        max_iterations=10**9,
        max_attempt=10**9,
        restarts=10**6,
    )


def starts_without_values():
    def function(x):
        calls.append(0)
        return x**2 + 1 if len(calls) < 5 else x * np.nan

    calls: list[int] = []
    ss.solve_mcp(function, -np.inf, np.inf, [3.0], jac=lambda x: np.diag(2 * x), restarts=10**9)


def sheared(friction):
    body = ss.Body(ss.Mesh.rectangle([0, 0], [2, 1], [8, 4]), ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]})
    ground = ss.Foundation.plane([0, 0], [0, 1])
    return ss.ContactProblem(body, "bottom", ground, friction, rate=body.motion("top", [0.05, None]))


def one_level():
    problem = sheared(ss.Friction.exponential(0.4, 0.2, 0.01))
    ss.evolve(problem, problem.solve(), [1.0], min_step=1e-12, step=1e-9, max_step=1e-9, max_points=10**12)


def many_levels():
    problem = sheared(0.4)
    ss.evolve(problem, problem.solve(), np.sin(np.arange(10.0**6)))


def transition_set():
    def family(x):
        return [x[0] ** 3 + ss.maximum(x[0], 0) - x[1] - x[2]]

    ss.transition_set(family, [0.0, 0.0, 0.0], 0, parameter_range=(0.0, 1.0), min_step=1e-12, step=1e-9, max_step=1e-9, max_points=10**12)


@pytest.mark.parametrize("work", [many_solutions, restarts, starts_without_values, one_level, many_levels, transition_set])
def test_ctrl_c_ends(work):
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
    finally:
        timer.cancel()


def test_interrupts_amid_conversions_come_out_unchanged():
    class Interrupted:
        def __array__(self, dtype=None, copy=None):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ss.solve_mcp(lambda x: Interrupted(), -np.inf, np.inf, [1.0], jac=lambda x: [[1.0]])
    with pytest.raises(KeyboardInterrupt):
        ss.solve_mcp(lambda x: x - 2, -np.inf, np.inf, [1.0], jac=lambda x: Interrupted())
