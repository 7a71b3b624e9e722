"""Batches of linear complementarity problems (n = 20, random, definite) against loops over the members.

python -B batches.py [MEMBERS]: a line for one and for all cores, and for each loop that can be run here, of a hundredth of the members at
most. `SEMISMOOTH_NUM_THREADS` sets the number of threads of a batch.
"""

import os
import subprocess
import sys
import time

import numpy as np

N = 20


def problems(members):
    rng = np.random.default_rng(0)
    A = rng.normal(size=(members, N, N))
    return A @ A.transpose(0, 2, 1) / N + 0.1 * np.eye(N), rng.normal(size=(members, N))


def seconds(work):
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def of_threads(members):
    """The time of a batch in this process."""
    import semismooth as ss

    M, q = problems(members)
    ss.solve_lcp(M[:100], q[:100])
    found = []
    print(min(seconds(lambda: found.append(ss.solve_lcp(M, q))) for _ in range(3)))
    assert found[0].solved.all()


def line(name, time_of_one):
    print(f"{name:44} {1e6 * time_of_one:8.1f} µs")


def loops(members):
    import semismooth as ss

    some = max(100, members // 100)
    M, q = problems(some)
    line("semismooth, a loop", seconds(lambda: [ss.solve_lcp(M[i], q[i]) for i in range(some)]) / some)
    try:
        from quantecon.optimize import lcp_lemke

        lcp_lemke(M[0], q[0])
        line("quantecon.optimize.lcp_lemke, a loop", seconds(lambda: [lcp_lemke(M[i], q[i]) for i in range(some)]) / some)
    except ImportError:
        print("quantecon is not installed")
    try:
        from qpsolvers import available_solvers, solve_qp

        for solver in available_solvers:
            work = lambda: [solve_qp(M[i], q[i], lb=np.zeros(N), solver=solver) for i in range(some)]  # noqa: B023
            line(f"qpsolvers with {solver}, a loop", seconds(work) / some)
    except ImportError:
        print("qpsolvers is not installed")


if __name__ == "__main__":
    if sys.argv[1:2] == ["threads"]:
        of_threads(int(sys.argv[2]))
    else:
        members = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
        for threads in [1, os.cpu_count()]:
            environment = {**os.environ, "SEMISMOOTH_NUM_THREADS": str(threads)}
            command = [sys.executable, "-B", __file__, "threads", str(members)]
            run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
            line(f"semismooth, a batch, {threads} thread(s)", float(run.stdout) / members)
        loops(members)
