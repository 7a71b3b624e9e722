"""Batches of linear complementarity problems (n = 20, random, definite) against loops over the members.

python -B batches.py [MEMBERS [TWIN]]: lines for one and for all cores, and for each loop that can be run here, of a hundredth of the
members at most. TWIN is the batch without Python (`cargo build --release --example batch_twin`). Beside the time that passes stands
that of the processors, which other programs on the machine disturb less. `SEMISMOOTH_NUM_THREADS` sets the number of threads of a batch.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

N = 20


def problems(members):
    rng = np.random.default_rng(0)
    A = rng.normal(size=(members, N, N))
    return A @ A.transpose(0, 2, 1) / N + 0.1 * np.eye(N), rng.normal(size=(members, N))


def seconds(work):
    """The time that passes, and that of all processors."""
    start, own = time.perf_counter(), time.process_time()
    work()
    return np.array([time.perf_counter() - start, time.process_time() - own])


def of_threads(folder, members):
    """The least times of a batch in this process."""
    import semismooth as ss

    M, q = (np.load(pathlib.Path(folder, name)) for name in ["M.npy", "q.npy"])
    ss.solve_lcp(M[:100], q[:100])
    found = []
    print(*np.min([seconds(lambda: found.append(ss.solve_lcp(M, q))) for _ in range(3)], axis=0))
    assert found[0].solved.all()


def line(name, times_of_one):
    print(f"{name:44} {1e6 * times_of_one[0]:8.1f} µs, of the processors {1e6 * times_of_one[1]:8.1f} µs")


def batches(members, twin):
    with tempfile.TemporaryDirectory() as folder:
        M, q = problems(members)
        np.save(pathlib.Path(folder, "M.npy"), M)
        np.save(pathlib.Path(folder, "q.npy"), q)
        both = pathlib.Path(folder, "M and q")
        with both.open("wb") as file:
            M.tofile(file)
            q.tofile(file)
        for threads in [1, os.cpu_count()]:
            environment = {**os.environ, "SEMISMOOTH_NUM_THREADS": str(threads)}
            commands = {"semismooth, a batch": [sys.executable, "-B", __file__, "threads", folder, str(members)]}
            if twin:
                commands["the same without Python"] = [twin, both, str(members), str(threads)]
            for name, command in commands.items():
                run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
                line(f"{name}, {threads} thread(s)", np.array(run.stdout.split(), float) / members)


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
        of_threads(sys.argv[2], int(sys.argv[3]))
    else:
        members = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
        batches(members, sys.argv[2] if len(sys.argv) > 2 else None)
        loops(members)
