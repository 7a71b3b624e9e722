"""Ctrl-C ends long runs of every kind, each of which would take hours."""

import faulthandler
import functools
import os
import signal
import threading
import time

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


@functools.cache
def reduced():
    body = ss.Body(ss.Mesh.block([0, 0, 0], [2, 2, 1], [10, 10, 5]), ss.Material(1.0, 0.3), supports={"top": [0.0, 0.0, -0.02]})
    ground = ss.Foundation.plane([0, 0, 0], [0, 0, 1])
    problem = ss.ContactProblem(body, "bottom", ground, 0.4, rate=body.motion("top", [0.05, 0.01, None]), form="reduced")
    return problem, problem.solve()


def reduced_form():
    problem, start = reduced()
    ss.evolve(problem, start, np.sin(np.arange(10.0**6)))


def transition_set():
    def family(x):
        return [x[0] ** 3 + ss.maximum(x[0], 0) - x[1] - x[2]]

    ss.transition_set(family, [0.0, 0.0, 0.0], 0, parameter_range=(0.0, 1.0), min_step=1e-12, step=1e-9, max_step=1e-9, max_points=10**12)


def diagram():
    # A helix in tiny steps, from many starts.
    helix = ss.trace(lambda x: [x[0] - np.sin(50 * x[2]), x[1] - np.cos(50 * x[2])], 3)
    starts = [[np.sin(50 * a), np.cos(50 * a), a] for a in np.linspace(0, 1, 1000)]
    ss.diagram(helix, starts, step=1e-6, max_step=1e-6, max_points=10**12)


def without_end(**more):
    """Iterates that tend to infinity or turn around, at whatever limits the options have."""
    return {"max_iterations": 10**9, "restarts": 10**6} | more


def inequality():
    ss.solve_vi(lambda x: np.exp(x) + np.roll(x, 1) ** 2 + 1, np.zeros(100), **without_end(max_attempt=10**9))


def cone():
    def residual(x):
        return x**2 + np.roll(x, 1) ** 2 + 1

    ss.solve_cone(residual, [("free", 30), ("second-order", 10)], np.ones(40), **without_end())


def pivots():
    # The problem of Murty (1978), for which Lemke's method takes exponentially many.
    n = 60
    ss.lemke(np.eye(n) + 2 * np.tril(np.ones((n, n)), -1), -np.ones(n), max_pivots=10**15)


def friction():
    # To a tolerance below rounding.
    rng = np.random.default_rng(0)
    H = rng.normal(size=(90, 20))
    ss.solve_friction(H @ H.T, H @ rng.normal(size=20), np.full(30, 0.8), tolerance=1e-300, max_sweeps=10**9, max_factorisations=10**9)


def first_solution():
    # A coefficient of friction that changes too fast with the slip.
    weird = ss.Friction.function(lambda slip, alpha: 0.5 + 0.4 * np.sin(1e9 * slip))
    sheared(weird).solve(1.0, max_increments=10**9, max_paths=10**9, max_points=10**9)


def minimum():
    # A function without a minimum, and one whose solution is not found.
    ss.minimise(lambda x, p: -x[0], lambda x, p: x - p, 0.0, 0.0, max_iterations=10**9)


def first_solve_of_a_minimum():
    ss.minimise(lambda x, p: x[0], lambda x, p: np.sin(1e3 * x) + x**2 + 1 + p, np.zeros(300), 1.0)


def stability():
    ss.follow_equilibria(lambda x: [x[0] - np.sin(50 * x[1])], [0.0, 0.0], step=1e-6, max_step=1e-6, max_points=10**12)


def arms():
    # At the start 2^40 selections meet, each with an arm.
    def residual(x):
        return [ss.minimum(x[40] - x[i], x[40] + x[i]) for i in range(40)]

    ss.follow(ss.trace(residual, 41), np.zeros(41), max_nodes=10**15)


WORK = [
    arms,
    many_solutions,
    restarts,
    starts_without_values,
    one_level,
    many_levels,
    reduced_form,
    transition_set,
    diagram,
    inequality,
    cone,
    pivots,
    friction,
    first_solution,
    minimum,
    first_solve_of_a_minimum,
    stability,
]


#: A run that does not look for signals ends the tests, with the place where it is, after this number of seconds.
WATCHDOG = 600


@pytest.mark.parametrize("work", WORK)
def test_ctrl_c_ends_long_runs(work):
    begun = threading.Event()

    def send():
        begun.wait()
        # By now, as a rule, the run is in the library; if it is not yet, the interpreter raises the same exception.
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=send)
    faulthandler.dump_traceback_later(WATCHDOG, exit=True)
    try:
        with pytest.raises(KeyboardInterrupt):
            thread.start()
            begun.set()
            # Runs that end are repeated: without the exception this never ends.
            while True:
                work()
    finally:
        thread.join()
        faulthandler.cancel_dump_traceback_later()


def test_interrupts_amid_conversions_come_out_unchanged():
    class Interrupted:
        def __array__(self, dtype=None, copy=None):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ss.solve_mcp(lambda x: Interrupted(), -np.inf, np.inf, [1.0], jac=lambda x: [[1.0]])
    with pytest.raises(KeyboardInterrupt):
        ss.solve_mcp(lambda x: x - 2, -np.inf, np.inf, [1.0], jac=lambda x: Interrupted())
