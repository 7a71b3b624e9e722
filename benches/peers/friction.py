#!/usr/bin/env python3
"""Friction problems u = M r + q by Siconos (package python3-siconos), compared with `friction_problem`.

    python3 benches/peers/friction.py [--runs 20] [--seconds 20] FILES...

FILES are in the format of `friction_problem`. Each solver of Siconos runs with dense and with sparse storage and its own tolerance 1e-12;
its time counts if the residual of the returned reactions, evaluated here, is at most 1e-10. One core; times are the least of --runs and of
both storages. A solver that takes longer than --seconds is stopped.
"""

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
import scipy.sparse

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SOLVERS = {
    2: ("NSGS", "CPG", "LEMKE", "ENUM"),
    3: ("NSGS", "NSN_AC", "NSN_FB", "PROX", "ADMM", "VI_EG", "DSFP", "NSGSV", "SOCLCP"),
}


def problem(path):
    with open(path) as file:
        data = json.load(file)
    n = data["nc"] * data["dimension"]
    m = data["M"]
    matrix = scipy.sparse.csc_matrix((m["data"], m["indices"], m["indptr"]), shape=(n, n))
    return data["dimension"], np.array(data["mu"]), matrix, np.array(data["q"])


def residual(dimension, mu, matrix, q, r):
    """The largest ‖r − P_K(r − (u + μ‖u_T‖ e) / s)‖ of a contact, s its mean stiffness, relative to the largest force due to q."""
    u = (matrix @ r + q).reshape(-1, dimension)
    s = np.maximum(matrix.diagonal().reshape(-1, dimension).mean(axis=1), 1e-300)
    r = r.reshape(-1, dimension)
    hat = u.copy()
    hat[:, 0] += mu * np.linalg.norm(u[:, 1:], axis=1)
    z = r - hat / s[:, None]
    normal, slip = z[:, 0], np.linalg.norm(z[:, 1:], axis=1)
    p = z.copy()
    polar = mu * slip <= -normal
    outside = ~polar & (slip > mu * normal)
    share = (normal + mu * slip) / (1 + mu**2)
    p[outside, 0] = share[outside]
    p[outside, 1:] *= (mu * share / np.maximum(slip, 1e-300))[outside, None]
    p[polar] = 0
    size = np.max(np.abs(q.reshape(-1, dimension)) / s[:, None])
    return np.max(np.linalg.norm(r - p, axis=1)) / max(size, 1e-300)


def one(path, name, storage, runs, pipe):
    """Least time and residual of one solver, in a separate process: some crash, some do not terminate."""
    import siconos.numerics as numerics

    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    dimension, mu, matrix, q = problem(path)
    given = matrix.toarray(order="F") if storage == "dense" else matrix
    driver = numerics.fc2d_driver if dimension == 2 else numerics.fc3d_driver
    least = None
    for _ in range(runs):
        options = numerics.SolverOptions(getattr(numerics, f"SICONOS_FRICTION_{dimension}D_{name}"))
        options.dparam[numerics.SICONOS_DPARAM_TOL] = 1e-12
        options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = 1_000_000
        contacts = numerics.FrictionContactProblem(dimension, len(mu), given, q, mu)
        r, u = np.zeros(len(q)), np.zeros(len(q))
        begun = time.perf_counter()
        driver(contacts, r, u, options)
        taken = time.perf_counter() - begun
        if least is None or taken < least[0]:
            least = (taken, residual(dimension, mu, matrix, q, r))
        pipe.send(least)


def fastest(path, name, runs, seconds):
    best = None
    for storage in ("dense", "sparse"):
        ours, theirs = multiprocessing.Pipe(duplex=False)
        process = multiprocessing.Process(target=one, args=(path, name, storage, runs, theirs))
        process.start()
        theirs.close()
        process.join(seconds)
        if process.is_alive():
            process.kill()
            process.join()
        try:
            while ours.poll():
                found = ours.recv()
                if found[1] <= 1e-10 and (best is None or found[0] < best[0]):
                    best = found
        except EOFError:
            pass
    return best


def crate(path, program, runs):
    """Least seconds, the residual measured here, and the status."""
    command = [program, "--json", "--repeat", str(runs), path]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return found["seconds"], residual(*problem(path), np.array(found["r"])), found["status"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=20.0)
    given = parser.parse_args()
    try:
        import siconos.numerics  # noqa: F401
    except ImportError:
        sys.exit("Siconos is not installed (package python3-siconos)")
    subprocess.run(["cargo", "build", "-q", "--release", "--example", "friction_problem"], cwd=ROOT, check=True)
    program = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release", "examples", "friction_problem")
    print(f"{'problem':40} {'contacts':>8}  {'ours ms':>9} {'residual':>8}  {'Siconos ms':>10} {'residual':>8}  solver, and how many arrived")
    slower = 0
    for path in given.files:
        dimension, mu, *_ = problem(path)
        found = {name: fastest(path, name, given.runs, given.seconds) for name in SOLVERS[dimension]}
        arrived = {name: value for name, value in found.items() if value is not None}
        seconds, error, status = crate(path, program, given.runs)
        title = os.path.basename(path).removesuffix(".json")
        line = f"{title[:40]:40} {len(mu):8}  {1e3 * seconds:9.3f} {error:8.1e}"
        if arrived:
            name = min(arrived, key=lambda key: arrived[key][0])
            slower += seconds > arrived[name][0]
            print(f"{line}  {1e3 * arrived[name][0]:10.3f} {arrived[name][1]:8.1e}  {name}, {len(arrived)} of {len(found)}")
        else:
            print(f"{line}  {'-':>10} {'-':>8}  none of {len(found)}")
        if status != "solved":
            print(f"    ours: {status}")
    print(f"a solver of Siconos is faster on {slower} of {len(given.files)}")


if __name__ == "__main__":
    main()
