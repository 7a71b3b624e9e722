"""Times of the package, one JSON object per line. `twin.rs` has the same problems, number by number."""

import json
import math
import time

import numpy as np
import scipy.sparse
import semismooth as ss


def numbers(count, seed=1):
    """Uniform in (−1/2, 1/2), by the generator of Knuth's MMIX."""
    state, values = seed, []
    for _ in range(count):
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        values.append((state >> 11) / 2**53 - 0.5)
    return values


def dense(n):
    M = np.array(numbers(n * n)).reshape(n, n)
    np.fill_diagonal(M, n / 8)
    q = np.array(numbers(n, seed=2))
    return lambda: ss.solve_lcp(M, q).residual


def sparse(m):
    line = scipy.sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(m, m))
    M = (scipy.sparse.kron(scipy.sparse.eye(m), line) + scipy.sparse.kron(line, scipy.sparse.eye(m))).tocsc()
    q = np.array(numbers(m * m, seed=3))
    return lambda: ss.solve_lcp(M, q).residual


def followed(n):
    mesh = ss.Mesh.rectangle([0, 0], [2, 1], [2 * n, n])
    body = ss.Body(mesh, ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]})
    ground = ss.Foundation.plane([0, 0], [0, 1])
    problem = ss.ContactProblem(body, "bottom", ground, 0.4, rate=body.motion("top", [0.05, None]))
    start = problem.solve(0.0)
    return lambda: len(ss.follow(problem, start, parameter_range=(0.0, 1.0)).transitions)


def listed(n):
    M = np.array(numbers(n * n, seed=4)).reshape(n, n)
    np.fill_diagonal(M, 0.0)
    lcp = ss.Lcp(M, -np.array(numbers(n, seed=5)) - 0.1)
    return lambda: len(ss.all_solutions(lcp))


if __name__ == "__main__":
    problems = {"dense LCP, n = 300": dense(300), "sparse LCP, n = 10 000": sparse(100), "followed block, 41 contact nodes": followed(20), "all solutions, LCP, n = 14": listed(14)}
    for name, work in problems.items():
        result, best, begun = work(), math.inf, time.perf_counter()
        while time.perf_counter() - begun < 1.0:
            before = time.perf_counter()
            work()
            best = min(best, time.perf_counter() - before)
        print(json.dumps({"name": name, "result": float(result), "seconds": best}))
