"""Families of the CUTE collection (I. Bongartz, A. R. Conn, N. Gould, Ph. L. Toint, 1995) other than those of Hock and Schittkowski:
bound-constrained and equality-constrained programs, and systems of equations, as Pyomo writes them.

Run: python -m unittest cute (with pyomo installed and the program's folder in PATH).
"""

import unittest

import hock_schittkowski
import pyomo.environ as pyo
from hock_schittkowski import Problem
from pyomo.environ import exp, log, sin, sqrt, value


def squares(terms):
    return sum(t**2 for t in terms)


def torsion(n, force):
    """Elastic-plastic torsion (TORSION1): ½ ∫ |∇v|² − c ∫ v with |v| at most the distance from the boundary of the unit square."""
    h = 1 / (n + 1)
    number = {(i, j): (i - 1) * n + j for i in range(1, n + 1) for j in range(1, n + 1)}

    def objective(x):
        def v(i, j):
            return x[number[i, j]] if (i, j) in number else 0.0

        edges = [v(i, j) - v(i - 1, j) for i in range(1, n + 2) for j in range(1, n + 1)]
        edges += [v(i, j) - v(i, j - 1) for i in range(1, n + 1) for j in range(1, n + 2)]
        return squares(edges) / 2 - force * h * h * sum(x[k] for k in number.values())

    distance = [h * min(i, j, n + 1 - i, n + 1 - j) for i, j in number]
    return Problem(distance, objective, lower=[-d for d in distance], upper=distance)


def obstacle(n):
    """A membrane over a lower obstacle (OBSTCLAE): ½ ∫ |∇v|² − ∫ v with v ≥ (sin 3.2x · sin 3.3y)³."""
    from math import sin as sine

    h = 1 / (n + 1)
    number = {(i, j): (i - 1) * n + j for i in range(1, n + 1) for j in range(1, n + 1)}

    def objective(x):
        def v(i, j):
            return x[number[i, j]] if (i, j) in number else 0.0

        edges = [v(i, j) - v(i - 1, j) for i in range(1, n + 2) for j in range(1, n + 1)]
        edges += [v(i, j) - v(i, j - 1) for i in range(1, n + 1) for j in range(1, n + 2)]
        return squares(edges) / 2 - h * h * sum(x[k] for k in number.values())

    floor = [(sine(3.2 * h * i) * sine(3.3 * h * j)) ** 3 for i, j in number]
    return Problem([max(f, 1.0) for f in floor], objective, lower=floor, upper=[2000.0] * len(floor))


def quadratic(n, sign):
    """CVXBQP1 (all signs +), NCVXBQP1 (negative in the last quarter): ½ Σ ± i (x_i + x_(2i−1 mod n)+1 + x_(3i−1 mod n)+1)²."""
    def objective(x):
        terms = [(i, x[i] + x[(2 * i - 1) % n + 1] + x[(3 * i - 1) % n + 1]) for i in range(1, n + 1)]
        return sum(sign(i) * i * t**2 for i, t in terms) / 2

    return Problem([0.5] * n, objective, lower=[0.1] * n, upper=[10.0] * n)


def each(n, f):
    """f of 1 … n."""
    return [f(i) for i in range(1, n + 1)]


BOUNDS = {
    "biggsb1": Problem(
        [0.0] * 50,
        lambda x: (x[1] - 1) ** 2 + (1 - x[50]) ** 2 + squares(x[i + 1] - x[i] for i in range(1, 50)),
        lower=[0.0] * 49 + [None],
        upper=[0.9] * 49 + [None],
    ),
    "camel6": Problem(
        [1.1, 1.1],
        lambda x: (4 - 2.1 * x[1] ** 2 + x[1] ** 4 / 3) * x[1] ** 2 + x[1] * x[2] + (-4 + 4 * x[2] ** 2) * x[2] ** 2,
        lower=[-3, -1.5],
        upper=[3, 1.5],
    ),
    "cvxbqp1": quadratic(50, lambda i: 1),
    "explin": Problem(
        [0.0] * 24,
        lambda x: sum(exp(0.1 * x[i] * x[i + 1]) for i in range(1, 11)) - 10 * sum(i * x[i] for i in range(1, 25)),
        lower=[0.0] * 24,
        upper=[10.0] * 24,
    ),
    "hatflda": Problem(
        [0.1] * 4,
        lambda x: (x[1] - 1) ** 2 + squares(x[i - 1] - sqrt(x[i]) for i in range(2, 5)),
        lower=[1e-7] * 4,
        best=0.0,
    ),
    "hatfldc": Problem(
        [0.9] * 25,
        lambda x: (x[1] - 1) ** 2 + (x[25] - 1) ** 2 + squares(x[i + 1] - x[i] ** 2 for i in range(2, 25)),
        lower=[0.0] * 24 + [None],
        upper=[10.0] * 24 + [None],
        best=0.0,
    ),
    "logros": Problem(
        [-1.2, 1.0], lambda x: log(1 + 10000 * (x[2] - x[1] ** 2) ** 2 + (1 - x[1]) ** 2), lower=[0.0, 0.0], best=0.0
    ),
    "mdhole": Problem([10.0, 1.0], lambda x: 100 * (sin(x[1]) - x[2]) ** 2 + x[1], lower=[0.0, None], best=0.0),
    "ncvxbqp1": quadratic(50, lambda i: 1 if i <= 37 else -1),
    "nonscomp": Problem(
        [3.0] * 20,
        lambda x: (x[1] - 1) ** 2 + 4 * squares(x[i] - x[i - 1] ** 2 for i in range(2, 21)),
        lower=each(20, lambda i: 1.0 if i % 2 == 0 else -100.0),
        upper=[100.0] * 20,
    ),
    "obstclae": obstacle(8),
    "pspdoc": Problem(
        [3.0] * 4,
        lambda x: sqrt(x[1] ** 2 + (x[2] - x[3]) ** 2 + 1) + sqrt(x[2] ** 2 + (x[3] - x[4]) ** 2 + 1),
        upper=[-1, None, None, None],
        best=1 + 2**0.5,
    ),
    "torsion1": torsion(8, 5.0),
    "torsion6": torsion(8, 20.0),
}

EQUALITIES = {
    "bt1": Problem(
        [0.08, 0.06],
        lambda x: -x[1] + 10 * (x[1] ** 2 + x[2] ** 2 - 1),
        lambda x: [x[1] ** 2 + x[2] ** 2 == 1],
    ),
    "bt3": Problem(
        [20.0] * 5,
        lambda x: (x[1] - x[2]) ** 2 + (x[2] + x[3] - 2) ** 2 + (x[4] - 1) ** 2 + (x[5] - 1) ** 2,
        lambda x: [x[1] + 3 * x[2] == 0, x[3] + x[4] - 2 * x[5] == 0, x[2] - x[5] == 0],
        best=4.0930232558,
    ),
    "bt5": Problem(
        [2.0] * 3,
        lambda x: 1000 - x[1] ** 2 - 2 * x[2] ** 2 - x[3] ** 2 - x[1] * x[2] - x[1] * x[3],
        lambda x: [x[1] ** 2 + x[2] ** 2 + x[3] ** 2 == 25, 8 * x[1] + 14 * x[2] + 7 * x[3] == 56],
        best=961.7151721,
    ),
    "bt9": Problem(
        [2.0] * 4,
        lambda x: -x[1],
        lambda x: [x[2] - x[1] ** 3 - x[3] ** 2 == 0, x[1] ** 2 - x[2] - x[4] ** 2 == 0],
    ),
    "bt10": Problem(
        [2.0] * 2, lambda x: -x[1], lambda x: [x[2] - x[1] ** 3 == 0, x[1] ** 2 - x[2] == 0], best=-1.0
    ),
    "bt12": Problem(
        [2.0] * 5,
        lambda x: 0.01 * x[1] ** 2 + x[2] ** 2,
        lambda x: [
            x[1] + x[2] - x[3] ** 2 == 25,
            x[1] ** 2 + x[2] ** 2 - x[4] ** 2 == 25,
            x[1] - x[5] ** 2 == 2,
        ],
    ),
    "byrdsphr": Problem(
        [5.0, 0.0001, -0.0001],
        lambda x: -x[1] - x[2] - x[3],
        lambda x: [x[1] ** 2 + x[2] ** 2 + x[3] ** 2 == 9, (x[1] - 1) ** 2 + x[2] ** 2 + x[3] ** 2 == 9],
    ),
    "genhs28": Problem(
        [-4.0] + [1.0] * 9,
        lambda x: squares(x[i] + x[i + 1] for i in range(1, 10)),
        lambda x: [x[i] + 2 * x[i + 1] + 3 * x[i + 2] == 1 for i in range(1, 9)],
        best=0.9271736931,
    ),
    "hs100lnp": Problem(
        [1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0],
        lambda x: (x[1] - 10) ** 2
        + 5 * (x[2] - 12) ** 2
        + x[3] ** 4
        + 3 * (x[4] - 11) ** 2
        + 10 * x[5] ** 6
        + 7 * x[6] ** 2
        + x[7] ** 4
        - 4 * x[6] * x[7]
        - 10 * x[6]
        - 8 * x[7],
        lambda x: [
            127 - 2 * x[1] ** 2 - 3 * x[2] ** 4 - x[3] - 4 * x[4] ** 2 - 5 * x[5] == 0,
            -4 * x[1] ** 2 - x[2] ** 2 + 3 * x[1] * x[2] - 2 * x[3] ** 2 - 5 * x[6] + 11 * x[7] == 0,
        ],
        best=680.6300573,
    ),
    "maratos": Problem(
        [1.1, 0.1],
        lambda x: -x[1] + 1e-6 * (x[1] ** 2 + x[2] ** 2 - 1),
        lambda x: [x[1] ** 2 + x[2] ** 2 == 1],
        best=-1.0,
    ),
}

# Systems: as many equations as variables.
SYSTEMS = {
    "argtrig": (
        [1 / 10] * 10,
        lambda x: [
            10 - sum(pyo.cos(x[j]) for j in range(1, 11)) + i * (1 - pyo.cos(x[i])) - sin(x[i]) == 0 for i in range(1, 11)
        ],
    ),
    "broydn3d": (
        [-1.0] * 50,
        lambda x: [
            (3 - 2 * x[i]) * x[i] - (x[i - 1] if i > 1 else 0) - 2 * (x[i + 1] if i < 50 else 0) + 1 == 0
            for i in range(1, 51)
        ],
    ),
    "powellbs": (
        [0.0, 1.0],
        lambda x: [10000 * x[1] * x[2] == 1, exp(-x[1]) + exp(-x[2]) == 1.0001],
    ),
}


class Cute(hock_schittkowski.HockSchittkowski):
    """The same checks as for the problems of Hock and Schittkowski."""

    problems = BOUNDS | EQUALITIES
    # Of another problem.
    test_no_kkt_point = None

    def test_systems(self):
        for name, (start, equations) in SYSTEMS.items():
            with self.subTest(name):
                m = pyo.ConcreteModel()
                m.x = pyo.Var(range(1, len(start) + 1), initialize=dict(enumerate(start, 1)))
                m.c = pyo.ConstraintList()
                for c in equations(m.x):
                    m.c.add(c)
                m.o = pyo.Objective(expr=0.0)
                results = pyo.SolverFactory("asl:semismooth").solve(m, load_solutions=False)
                self.assertEqual(results.solver.id, 0, results.solver.message)
                m.solutions.load_from(results)
                for c in m.c.values():
                    self.assertLessEqual(abs(value(c.body) - value(c.lower)), 1e-6 * (1 + abs(value(c.lower))))


if __name__ == "__main__":
    unittest.main()
