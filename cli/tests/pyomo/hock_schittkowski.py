"""Problems of W. Hock and K. Schittkowski (1981: "Test examples for nonlinear programming codes") as Pyomo writes them.

The claim of the program, a KKT point, is checked with derivatives from Pyomo: stationarity, signs of multipliers, complementarity. If the
start leads to the known minimum, its value is compared, too.

Run: python -m unittest hock_schittkowski (with pyomo installed and the program's folder in PATH).
"""

import unittest
from math import asin, log, pi, sqrt

import pyomo.environ as pyo
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.visitor import identify_variables
from pyomo.environ import ConcreteModel, ConstraintList, Objective, Var, cos, exp, sin, value

TOLERANCE = 1e-6


def gradient(expression):
    """Derivatives by variable, by Pyomo's reverse sweep."""
    variables = list(identify_variables(expression))
    slopes = differentiate(expression, wrt_list=variables, mode=Modes.reverse_numeric)
    return {v.name: slope for v, slope in zip(variables, slopes)}


class Problem:
    """minimise objective(x) subject to constraints(x) and bounds; `best` is the known minimum where the start leads there, else None."""

    def __init__(self, start, objective, constraints=lambda x: [], lower=None, upper=None, best=None):
        self.start, self.objective, self.constraints = start, objective, constraints
        self.lower, self.upper, self.best = lower, upper, best

    def model(self):
        m = ConcreteModel()
        n = len(self.start)
        bounds = zip(self.lower or [None] * n, self.upper or [None] * n)
        m.x = Var(range(1, n + 1), initialize=dict(enumerate(self.start, 1)))
        for i, (low, high) in enumerate(bounds, 1):
            m.x[i].setlb(low)
            m.x[i].setub(high)
        m.o = Objective(expr=self.objective(m.x))
        m.c = ConstraintList()
        for c in self.constraints(m.x):
            m.c.add(c)
        m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
        return m


PROBLEMS = {
    "hs2": Problem(
        [-2, 1], lambda x: 100 * (x[2] - x[1] ** 2) ** 2 + (1 - x[1]) ** 2, lower=[None, 1.5], best=0.0504261879
    ),
    "hs5": Problem(
        [0, 0],
        lambda x: sin(x[1] + x[2]) + (x[1] - x[2]) ** 2 - 1.5 * x[1] + 2.5 * x[2] + 1,
        lower=[-1.5, -3],
        upper=[4, 3],
        best=-1.913222955,
    ),
    "hs8": Problem(
        [2, 1], lambda x: -1 + 0 * x[1] * x[2], lambda x: [x[1] ** 2 + x[2] ** 2 == 25, x[1] * x[2] == 9], best=-1
    ),
    "hs9": Problem(
        [0, 0], lambda x: sin(pi * x[1] / 12) * cos(pi * x[2] / 16), lambda x: [4 * x[1] - 3 * x[2] == 0], best=-0.5
    ),
    "hs10": Problem(
        [-10, 10], lambda x: x[1] - x[2], lambda x: [-3 * x[1] ** 2 + 2 * x[1] * x[2] - x[2] ** 2 + 1 >= 0], best=-1
    ),
    "hs11": Problem(
        [4.9, 0.1], lambda x: (x[1] - 5) ** 2 + x[2] ** 2 - 25, lambda x: [-x[1] ** 2 + x[2] >= 0], best=-8.498464223
    ),
    "hs12": Problem(
        [0, 0],
        lambda x: 0.5 * x[1] ** 2 + x[2] ** 2 - x[1] * x[2] - 7 * x[1] - 7 * x[2],
        lambda x: [25 - 4 * x[1] ** 2 - x[2] ** 2 >= 0],
        best=-30,
    ),
    "hs14": Problem(
        [2, 2],
        lambda x: (x[1] - 2) ** 2 + (x[2] - 1) ** 2,
        lambda x: [-0.25 * x[1] ** 2 - x[2] ** 2 + 1 >= 0, x[1] - 2 * x[2] + 1 == 0],
        best=1.393464981,
    ),
    "hs15": Problem(
        [-2, 1],
        lambda x: 100 * (x[2] - x[1] ** 2) ** 2 + (1 - x[1]) ** 2,
        lambda x: [x[1] * x[2] - 1 >= 0, x[1] + x[2] ** 2 >= 0],
        upper=[0.5, None],
        best=306.5,
    ),
    "hs16": Problem(
        [-2, 1],
        lambda x: 100 * (x[2] - x[1] ** 2) ** 2 + (1 - x[1]) ** 2,
        lambda x: [x[1] + x[2] ** 2 >= 0, x[1] ** 2 + x[2] >= 0],
        lower=[-2, None],
        upper=[0.5, 1],
        best=None,
    ),
    "hs18": Problem(
        [2, 2],
        lambda x: 0.01 * x[1] ** 2 + x[2] ** 2,
        lambda x: [x[1] * x[2] - 25 >= 0, x[1] ** 2 + x[2] ** 2 - 25 >= 0],
        lower=[2, 0],
        upper=[50, 50],
        best=5,
    ),
    "hs19": Problem(
        [20.1, 5.84],
        lambda x: (x[1] - 10) ** 3 + (x[2] - 20) ** 3,
        lambda x: [(x[1] - 5) ** 2 + (x[2] - 5) ** 2 - 100 >= 0, -((x[2] - 5) ** 2) - (x[1] - 6) ** 2 + 82.81 >= 0],
        lower=[13, 0],
        upper=[100, 100],
        best=-6961.81381,
    ),
    "hs22": Problem(
        [2, 2],
        lambda x: (x[1] - 2) ** 2 + (x[2] - 1) ** 2,
        lambda x: [-x[1] - x[2] + 2 >= 0, -x[1] ** 2 + x[2] >= 0],
        best=1,
    ),
    "hs23": Problem(
        [3, 1],
        lambda x: x[1] ** 2 + x[2] ** 2,
        lambda x: [
            x[1] + x[2] >= 1,
            x[1] ** 2 + x[2] ** 2 >= 1,
            9 * x[1] ** 2 + x[2] ** 2 >= 9,
            x[1] ** 2 - x[2] >= 0,
            x[2] ** 2 - x[1] >= 0,
        ],
        lower=[-50] * 2,
        upper=[50] * 2,
        best=2,
    ),
    "hs24": Problem(
        [1, 0.5],
        lambda x: ((x[1] - 3) ** 2 - 9) * x[2] ** 3 / (27 * sqrt(3)),
        lambda x: [x[1] / sqrt(3) - x[2] >= 0, x[1] + sqrt(3) * x[2] >= 0, -x[1] - sqrt(3) * x[2] + 6 >= 0],
        lower=[0, 0],
        best=None,
    ),
    "hs26": Problem(
        [-2.6, 2, 2],
        lambda x: (x[1] - x[2]) ** 2 + (x[2] - x[3]) ** 4,
        lambda x: [(1 + x[2] ** 2) * x[1] + x[3] ** 4 - 3 == 0],
        best=0,
    ),
    "hs27": Problem(
        [2, 2, 2],
        lambda x: 0.01 * (x[1] - 1) ** 2 + (x[2] - x[1] ** 2) ** 2,
        lambda x: [x[1] + x[3] ** 2 + 1 == 0],
        best=0.04,
    ),
    "hs29": Problem(
        [1, 1, 1],
        lambda x: -x[1] * x[2] * x[3],
        lambda x: [-x[1] ** 2 - 2 * x[2] ** 2 - 4 * x[3] ** 2 + 48 >= 0],
        best=None,
    ),
    "hs30": Problem(
        [1, 1, 1],
        lambda x: x[1] ** 2 + x[2] ** 2 + x[3] ** 2,
        lambda x: [x[1] ** 2 + x[2] ** 2 >= 1],
        lower=[1, -10, -10],
        upper=[10] * 3,
        best=1,
    ),
    "hs32": Problem(
        [0.1, 0.7, 0.2],
        lambda x: (x[1] + 3 * x[2] + x[3]) ** 2 + 4 * (x[1] - x[2]) ** 2,
        lambda x: [6 * x[2] + 4 * x[3] - x[1] ** 3 - 3 >= 0, 1 - x[1] - x[2] - x[3] == 0],
        lower=[0] * 3,
        best=1,
    ),
    "hs33": Problem(
        [0, 0, 3],
        lambda x: (x[1] - 1) * (x[1] - 2) * (x[1] - 3) + x[3],
        lambda x: [x[3] ** 2 - x[2] ** 2 - x[1] ** 2 >= 0, x[1] ** 2 + x[2] ** 2 + x[3] ** 2 - 4 >= 0],
        lower=[0] * 3,
        upper=[None, None, 5],
        best=None,
    ),
    "hs34": Problem(
        [0, 1.05, 2.9],
        lambda x: -x[1],
        lambda x: [x[2] - exp(x[1]) >= 0, x[3] - exp(x[2]) >= 0],
        lower=[0] * 3,
        upper=[100, 100, 10],
        best=-log(log(10)),
    ),
    "hs36": Problem(
        [10] * 3,
        lambda x: -x[1] * x[2] * x[3],
        lambda x: [72 - x[1] - 2 * x[2] - 2 * x[3] >= 0],
        lower=[0] * 3,
        upper=[20, 11, 42],
        best=None,
    ),
    "hs37": Problem(
        [10] * 3,
        lambda x: -x[1] * x[2] * x[3],
        lambda x: [72 - x[1] - 2 * x[2] - 2 * x[3] >= 0, x[1] + 2 * x[2] + 2 * x[3] >= 0],
        lower=[0] * 3,
        upper=[42] * 3,
        best=None,
    ),
    "hs38": Problem(
        [-3, -1, -3, -1],
        lambda x: 100 * (x[2] - x[1] ** 2) ** 2
        + (1 - x[1]) ** 2
        + 90 * (x[4] - x[3] ** 2) ** 2
        + (1 - x[3]) ** 2
        + 10.1 * ((x[2] - 1) ** 2 + (x[4] - 1) ** 2)
        + 19.8 * (x[2] - 1) * (x[4] - 1),
        lower=[-10] * 4,
        upper=[10] * 4,
        best=None,
    ),
    "hs39": Problem(
        [2] * 4,
        lambda x: -x[1],
        lambda x: [x[2] - x[1] ** 3 - x[3] ** 2 == 0, x[1] ** 2 - x[2] - x[4] ** 2 == 0],
        best=-1,
    ),
    "hs40": Problem(
        [0.8] * 4,
        lambda x: -x[1] * x[2] * x[3] * x[4],
        lambda x: [x[1] ** 3 + x[2] ** 2 == 1, x[1] ** 2 * x[4] - x[3] == 0, x[4] ** 2 - x[2] == 0],
        best=-0.25,
    ),
    "hs42": Problem(
        [1] * 4,
        lambda x: sum((x[i] - i) ** 2 for i in range(1, 5)),
        lambda x: [x[1] - 2 == 0, x[3] ** 2 + x[4] ** 2 - 2 == 0],
        best=28 - 10 * sqrt(2),
    ),
    "hs45": Problem(
        [2] * 5, lambda x: 2 - x[1] * x[2] * x[3] * x[4] * x[5] / 120, lower=[0] * 5, upper=[1, 2, 3, 4, 5], best=None
    ),
    "hs47": Problem(
        [2, sqrt(2), -1, 2 - sqrt(2), 0.5],
        lambda x: (x[1] - x[2]) ** 2 + (x[2] - x[3]) ** 3 + (x[3] - x[4]) ** 4 + (x[4] - x[5]) ** 4,
        lambda x: [x[1] + x[2] ** 2 + x[3] ** 3 == 3, x[2] - x[3] ** 2 + x[4] == 1, x[1] * x[5] == 1],
        best=0,
    ),
    "hs48": Problem(
        [3, 5, -3, 2, -2],
        lambda x: (x[1] - 1) ** 2 + (x[2] - x[3]) ** 2 + (x[4] - x[5]) ** 2,
        lambda x: [sum(x[i] for i in range(1, 6)) == 5, x[3] - 2 * (x[4] + x[5]) == -3],
        best=0,
    ),
    "hs56": Problem(
        [1, 1, 1, asin(sqrt(1 / 4.2)), asin(sqrt(1 / 4.2)), asin(sqrt(1 / 4.2)), asin(sqrt(5 / 7.2))],
        lambda x: -x[1] * x[2] * x[3],
        lambda x: [
            x[1] - 4.2 * sin(x[4]) ** 2 == 0,
            x[2] - 4.2 * sin(x[5]) ** 2 == 0,
            x[3] - 4.2 * sin(x[6]) ** 2 == 0,
            x[1] + 2 * x[2] + 2 * x[3] - 7.2 * sin(x[7]) ** 2 == 0,
        ],
        best=-3.456,
    ),
    "hs61": Problem(
        [0] * 3,
        lambda x: 4 * x[1] ** 2 + 2 * x[2] ** 2 + 2 * x[3] ** 2 - 33 * x[1] + 16 * x[2] - 24 * x[3],
        lambda x: [3 * x[1] - 2 * x[2] ** 2 == 7, 4 * x[1] - x[3] ** 2 == 11],
        best=-143.6461422,
    ),
    "hs63": Problem(
        [2] * 3,
        lambda x: 1000 - x[1] ** 2 - 2 * x[2] ** 2 - x[3] ** 2 - x[1] * x[2] - x[1] * x[3],
        lambda x: [8 * x[1] + 14 * x[2] + 7 * x[3] == 56, x[1] ** 2 + x[2] ** 2 + x[3] ** 2 == 25],
        lower=[0] * 3,
        best=961.7151721,
    ),
    "hs64": Problem(
        [1] * 3,
        lambda x: 5 * x[1] + 50000 / x[1] + 20 * x[2] + 72000 / x[2] + 10 * x[3] + 144000 / x[3],
        lambda x: [1 - 4 / x[1] - 32 / x[2] - 120 / x[3] >= 0],
        lower=[1e-5] * 3,
        best=6299.842428,
    ),
    "hs65": Problem(
        [-5, 5, 0],
        lambda x: (x[1] - x[2]) ** 2 + (x[1] + x[2] - 10) ** 2 / 9 + (x[3] - 5) ** 2,
        lambda x: [48 - x[1] ** 2 - x[2] ** 2 - x[3] ** 2 >= 0],
        lower=[-4.5, -4.5, -5],
        upper=[4.5, 4.5, 5],
        best=0.9535288567,
    ),
    "hs66": Problem(
        [0, 1.05, 2.9],
        lambda x: 0.2 * x[3] - 0.8 * x[1],
        lambda x: [x[2] - exp(x[1]) >= 0, x[3] - exp(x[2]) >= 0],
        lower=[0] * 3,
        upper=[100, 100, 10],
        best=0.5181632741,
    ),
    "hs76": Problem(
        [0.5] * 4,
        lambda x: x[1] ** 2
        + 0.5 * x[2] ** 2
        + x[3] ** 2
        + 0.5 * x[4] ** 2
        - x[1] * x[3]
        + x[3] * x[4]
        - x[1]
        - 3 * x[2]
        + x[3]
        - x[4],
        lambda x: [x[1] + 2 * x[2] + x[3] + x[4] <= 5, 3 * x[1] + x[2] + 2 * x[3] - x[4] <= 4, x[2] + 4 * x[3] >= 1.5],
        lower=[0] * 4,
        best=-4.681818181,
    ),
    "hs77": Problem(
        [2] * 5,
        lambda x: (x[1] - 1) ** 2 + (x[1] - x[2]) ** 2 + (x[3] - 1) ** 2 + (x[4] - 1) ** 4 + (x[5] - 1) ** 6,
        lambda x: [x[1] ** 2 * x[4] + sin(x[4] - x[5]) == 2 * sqrt(2), x[2] + x[3] ** 4 * x[4] ** 2 == 8 + sqrt(2)],
        best=0.24150513,
    ),
    "hs78": Problem(
        [-2, 1.5, 2, -1, -1],
        lambda x: x[1] * x[2] * x[3] * x[4] * x[5],
        lambda x: [
            sum(x[i] ** 2 for i in range(1, 6)) == 10,
            x[2] * x[3] - 5 * x[4] * x[5] == 0,
            x[1] ** 3 + x[2] ** 3 == -1,
        ],
        best=-2.91970041,
    ),
    "hs80": Problem(
        [-2, 2, 2, -1, -1],
        lambda x: exp(x[1] * x[2] * x[3] * x[4] * x[5]),
        lambda x: [
            sum(x[i] ** 2 for i in range(1, 6)) == 10,
            x[2] * x[3] - 5 * x[4] * x[5] == 0,
            x[1] ** 3 + x[2] ** 3 == -1,
        ],
        lower=[-2.3, -2.3, -3.2, -3.2, -3.2],
        upper=[2.3, 2.3, 3.2, 3.2, 3.2],
        best=None,
    ),
    "hs100": Problem(
        [1, 2, 0, 4, 0, 1, 1],
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
            127 - 2 * x[1] ** 2 - 3 * x[2] ** 4 - x[3] - 4 * x[4] ** 2 - 5 * x[5] >= 0,
            282 - 7 * x[1] - 3 * x[2] - 10 * x[3] ** 2 - x[4] + x[5] >= 0,
            196 - 23 * x[1] - x[2] ** 2 - 6 * x[6] ** 2 + 8 * x[7] >= 0,
            -4 * x[1] ** 2 - x[2] ** 2 + 3 * x[1] * x[2] - 2 * x[3] ** 2 - 5 * x[6] + 11 * x[7] >= 0,
        ],
        best=680.6300573,
    ),
}


class HockSchittkowski(unittest.TestCase):
    problems = PROBLEMS

    def check(self, name):
        problem = self.problems[name]
        m = problem.model()
        results = pyo.SolverFactory("asl:semismooth").solve(m, load_solutions=False)
        self.assertEqual(results.solver.id, 0, results.solver.message)
        m.solutions.load_from(results)
        slope = {v.name: 0.0 for v in m.x.values()}
        for variable, s in gradient(m.o.expr).items():
            slope[variable] += s
        size = 1 + max(abs(s) for s in slope.values())
        for c in m.c.values():
            y, body = m.dual.get(c, 0.0), value(c.body)
            size = max(size, abs(y))
            low = value(c.lower) if c.lower is not None else None
            high = value(c.upper) if c.upper is not None else None
            scale = TOLERANCE * (1 + abs(body))
            self.assertTrue(low is None or body >= low - scale)
            self.assertTrue(high is None or body <= high + scale)
            # The sign of a multiplier depends on the active bound; it is zero at inactive constraints.
            if low is None or body > low + 100 * scale:
                self.assertLessEqual(y, TOLERANCE * size)
            if high is None or body < high - 100 * scale:
                self.assertGreaterEqual(y, -TOLERANCE * size)
            for variable, s in gradient(c.body).items():
                slope[variable] -= y * s
        for v in m.x.values():
            s = slope[v.name]
            self.assertTrue(v.lb is None or value(v) >= v.lb)
            self.assertTrue(v.ub is None or value(v) <= v.ub)
            if v.lb is None or value(v) > v.lb + 1e-5:
                self.assertLessEqual(s, TOLERANCE * size)
            if v.ub is None or value(v) < v.ub - 1e-5:
                self.assertGreaterEqual(s, -TOLERANCE * size)
        if problem.best is not None:
            self.assertLessEqual(abs(value(m.o) - problem.best), 1e-5 * (1 + abs(problem.best)))

    def test_kkt_points(self):
        for name in self.problems:
            with self.subTest(name):
                self.check(name)

    def test_no_kkt_point(self):
        """HS 13: no constraint qualification holds at the minimum, and there are no multipliers."""
        m = Problem(
            [-2, -2], lambda x: (x[1] - 2) ** 2 + x[2] ** 2, lambda x: [(1 - x[1]) ** 3 - x[2] >= 0], lower=[0, 0]
        ).model()
        results = pyo.SolverFactory("asl:semismooth").solve(m, load_solutions=False)
        self.assertGreaterEqual(results.solver.id, 400)
        self.assertNotIn("KKT point", results.solver.message)


if __name__ == "__main__":
    unittest.main()
