#!/usr/bin/env python3
"""Complementarity problems solved by other programs, compared with this crate.

    python3 benches/peers/complementarity.py [--m 400] [--runs 3]

Runs PETSc's SNESVI (package python3-petsc4py) on MCPLIB's obstacle problem and on the hemisphere from the stated starts, and
Siconos' Lemke (package python3-siconos) on a dense Harker-Pang problem; programs that are not installed are skipped with a message. Then
runs the examples of this crate for the same problems. All on one core; times are the least of --runs.
"""

import argparse
import glob
import math
import os
import subprocess
import sys
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
R_STAR = 0.697965148223374


def psi(r):
    edge = math.sqrt(1.0 - 0.81)
    return math.sqrt(1.0 - r * r) if r <= 0.9 else edge - 0.9 / edge * (r - 0.9)


def exact(r):
    return psi(r) if r <= R_STAR else -0.68026 * math.log(r) + 0.47152


def obstacle(problem, m):
    """Compressed rows of the matrix, q, bounds and start of a problem on m x m points."""
    import numpy as np

    corner, side, load = {"mcplib": (0.0, 1.0, 1.0), "hemisphere": (-2.0, 4.0, 0.0)}[problem]
    h = side / (m + 1)
    at = corner + h * np.arange(m + 2)
    x, y = np.meshgrid(at[1:-1], at[1:-1])
    index = np.arange(m * m).reshape(m, m)
    rows, cols, values = [index.ravel()], [index.ravel()], [np.full(m * m, 4.0)]
    for a, b in ((index[:, 1:], index[:, :-1]), (index[1:], index[:-1])):
        for i, j in ((a, b), (b, a)):
            rows.append(i.ravel())
            cols.append(j.ravel())
            values.append(np.full(i.size, -1.0))
    rows, cols, values = (np.concatenate(v) for v in (rows, cols, values))
    order = np.lexsort((cols, rows))
    start = np.concatenate(([0], np.cumsum(np.bincount(rows, minlength=m * m))))
    q = np.full((m, m), -h * h * load)
    if problem == "hemisphere":
        for k in range(m):
            q[k, 0] -= exact(math.hypot(at[0], at[k + 1]))
            q[k, -1] -= exact(math.hypot(at[-1], at[k + 1]))
            q[0, k] -= exact(math.hypot(at[k + 1], at[0]))
            q[-1, k] -= exact(math.hypot(at[k + 1], at[-1]))
        lower = np.vectorize(psi)(np.hypot(x, y)).ravel()
        upper = np.full(m * m, 1e20)
    else:
        s = np.sin(9.2 * x) * np.sin(9.3 * y)
        lower, upper = (s**3).ravel(), (s * s + 0.2).ravel()
    matrix = (start.astype("int32"), cols[order].astype("int32"), values[order])
    return matrix, q.ravel(), lower, upper, np.maximum(0.0, lower)


def least(runs, work):
    results = []
    for _ in range(runs):
        begun = time.process_time()
        result = work()
        results.append((time.process_time() - begun, result))
    return min(results, key=lambda r: r[0])


def petsc(m, runs):
    # Debian keeps the bindings with each build of the library, and links them into Python's path where alternatives are set up.
    sys.path += glob.glob("/usr/lib/petscdir/petsc3*/*-real/lib/python3/dist-packages")
    try:
        import petsc4py

        petsc4py.init(["-snes_max_it", "500"])
        from petsc4py import PETSc
    except ImportError:
        print("PETSc: petsc4py is not installed (Debian package python3-petsc4py); skipped")
        return
    print("PETSc", ".".join(map(str, PETSc.Sys.getVersion())))
    for problem in ("mcplib", "hemisphere"):
        (start, cols, values), q, lower, upper, z0 = obstacle(problem, m)

        def work():
            a = PETSc.Mat().createAIJ((m * m, m * m), csr=(start, cols, values), comm=PETSc.COMM_SELF)
            vector = lambda v: PETSc.Vec().createWithArray(v.copy(), comm=PETSc.COMM_SELF)
            rhs, z = vector(q), vector(z0)

            def function(snes, x, f):
                a.mult(x, f)
                f.axpy(1.0, rhs)

            snes = PETSc.SNES().create(comm=PETSc.COMM_SELF)
            snes.setType("vinewtonrsls")
            snes.setFunction(function, rhs.duplicate())
            snes.setJacobian(lambda snes, x, j, p: None, a)
            snes.setVariableBounds(vector(lower), vector(upper))
            snes.getKSP().setType("preonly")
            snes.getKSP().getPC().setType("lu")
            snes.setFromOptions()
            snes.solve(None, z)
            return snes.getIterationNumber(), snes.getConvergedReason()

        seconds, (iterations, reason) = least(runs, work)
        print(f"  {problem:12} m = {m}: {iterations} iterations, reason {reason}, {seconds:.3f} CPU s")


def siconos(runs, n=1000):
    try:
        import numpy as np
        import siconos.numerics as sn
    except ImportError:
        print("Siconos: siconos.numerics is not installed (Debian package python3-siconos); skipped")
        return
    random = np.random.default_rng(7)
    a, b = random.uniform(-5, 5, (n, n)), np.triu(random.uniform(-5, 5, (n, n)), 1)
    matrix = a.T @ a + b - b.T + np.diag(random.uniform(0, 0.3, n))
    q = random.uniform(-500, 500, n)
    problem = sn.LCP(matrix, q)

    def work():
        z, w = np.zeros(n), np.zeros(n)
        options = sn.SolverOptions(sn.SICONOS_LCP_LEMKE)
        info = sn.linearComplementarity_driver(problem, z, w, options)
        return info, float(np.abs(np.minimum(z, matrix @ z + q)).max())

    seconds, (info, residual) = least(runs, work)
    print(f"Siconos Lemke, Harker-Pang n = {n}: info {info}, residual {residual:.1e}, {seconds:.3f} CPU s")


def ours(m):
    command = ["cargo", "run", "-q", "--release", "--example", "obstacle", "--", "--m", str(m)]
    for problem in ("mcplib", "hemisphere"):
        for nested in ([], ["--nested"]):
            subprocess.run(command + ["--problem", problem, "--out", "target/peers"] + nested, cwd=ROOT, check=True)
    print("dense problems: cargo bench --bench complementarity -- dense")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--m", type=int, default=400, help="interior points a side of the obstacle problems")
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    if arguments.m < 3 or arguments.runs < 1:
        parser.error("--m must be at least 3, --runs at least 1")
    petsc(arguments.m, arguments.runs)
    siconos(arguments.runs)
    sys.stdout.flush()
    ours(arguments.m)


if __name__ == "__main__":
    main()
