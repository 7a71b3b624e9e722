"""Mathematical programs with equilibrium constraints as a user of Pyomo writes them, with the optimal values of MacMPEC (S. Leyffer, 2000).

Run: python mpecs.py (with pyomo installed and the program's folder in PATH).
"""

import unittest

import pyomo.environ as pyo
from models import Case, solve
from pyomo.common.errors import ApplicationError
from pyomo.environ import ConcreteModel, Constraint, Objective, Var, value
from pyomo.mpec import Complementarity, complements


def outrata(objective):
    m = ConcreteModel()
    m.x = Var(range(1, 5), bounds=(0, None), initialize=1)
    m.y = Var(bounds=(0, 10), initialize=5)
    x, y = m.x, m.y
    rows = [
        (1 + 0.2 * y) * x[1] - (3 + 1.333 * y) - 0.333 * x[3] + 2 * x[1] * x[4],
        (1 + 0.1 * y) * x[2] - y + x[3] + 2 * x[2] * x[4],
        0.333 * x[1] - x[2] + 1 - 0.1 * y,
        9 + 0.1 * y - x[1] ** 2 - x[2] ** 2,
    ]
    m.c = Complementarity(range(1, 5), rule=lambda m, i: complements(m.x[i] >= 0, rows[i - 1] >= 0))
    m.o = Objective(expr=objective(x, y))
    return m


def gnash(gamma, most):
    cost, power = [10, 8, 6, 4, 2], [1.2, 1.1, 1.0, 0.9, 0.8]
    m = ConcreteModel()
    m.x = Var(bounds=(0, most), initialize=most / 2)
    m.y = Var(range(1, 5), bounds=(0, None), initialize=min(15, most))
    m.u = Var(range(1, 5), bounds=(0, None), initialize=0)
    total, scale = m.x + sum(m.y[i] for i in m.y), 5000 ** (1 / gamma)
    price, fall = scale * total ** (-1 / gamma), scale / gamma * total ** (-1 - 1 / gamma)
    slope = [5 ** (-1 / b) for b in power]

    def loss(m, i):
        return cost[i] + slope[i] * m.y[i] - price + m.y[i] * fall

    # The price u of the capacity of each follower.
    m.g = Complementarity(range(1, 5), rule=lambda m, i: complements(m.y[i] >= 0, loss(m, i) + m.u[i] >= 0))
    m.h = Complementarity(range(1, 5), rule=lambda m, i: complements(m.u[i] >= 0, most - m.y[i] >= 0))
    b = power[0]
    m.o = Objective(expr=cost[0] * m.x + b / (b + 1) * slope[0] * m.x ** ((1 + b) / b) - m.x * price)
    return m


class Mpecs(Case):
    def stationary(self, model, expected, digits):
        results = self.solved(model)
        self.assertIn("Stationary in the sense of Clarke", results.solver.message)
        self.assertIn("has not been decided", results.solver.message)
        self.assertLessEqual(abs(value(model.o) - expected), 0.5000001 * 10.0**-digits)

    def test_outrata(self):
        def near(x):
            return (x[1] - 3) ** 2 + (x[2] - 4) ** 2

        self.stationary(outrata(lambda x, y: near(x) / 2), 3.2077, 4)
        self.stationary(outrata(lambda x, y: (near(x) + (x[3] - 1) ** 2) / 2), 3.4494, 4)
        self.stationary(outrata(lambda x, y: (near(x) + 10 * x[4] ** 2) / 2), 4.60425, 5)
        self.stationary(
            outrata(lambda x, y: (near(x) + (x[3] - 1) ** 2 + (x[4] - 1) ** 2 + y**2) / 2), 6.59268, 5
        )

    def test_gnash(self):
        self.stationary(gnash(1.0, 150), -230.823, 3)
        self.stationary(gnash(1.3, 30), -90.7491, 4)
        self.stationary(gnash(1.7, 20), -6.11671, 5)

    def market(self, bounds=(0, 200)):
        """stackelberg1: the follower's multiplier is the slack of his condition."""
        m = ConcreteModel()
        m.x, m.y = Var(bounds=bounds, initialize=50), Var(bounds=(0, None))
        m.c = Complementarity(expr=complements(m.y >= 0, 2 * m.y + 0.5 * m.x - 100 >= 0))
        m.o = Objective(expr=0.5 * m.x**2 + 0.5 * m.x * m.y - 95 * m.x)
        return m

    def test_stackelberg(self):
        self.stationary(self.market(), -3266.67, 2)

    def test_maximum(self):
        m = self.market()
        m.del_component(m.o)
        m.o = Objective(expr=95 * m.x - 0.5 * m.x * m.y - 0.5 * m.x**2, sense=pyo.maximize)
        self.stationary(m, 3266.67, 2)

    def test_without_bounds(self):
        """jr1: a free upper-level variable."""
        m = ConcreteModel()
        m.z, m.y = Var(initialize=3), Var(bounds=(0, None))
        m.c = Complementarity(expr=complements(m.y >= 0, m.y - m.z >= 0))
        m.o = Objective(expr=(m.z - 1) ** 2 + m.y**2)
        self.stationary(m, 0.5, 1)

    def test_linear_inequality(self):
        m = self.market()
        m.limit = Constraint(expr=2 * m.x <= 100)
        # At x = 50 the follower's y is 37.5.
        self.stationary(m, 0.5 * 2500 + 25 * 37.5 - 95 * 50, 5)
        self.near(m.x, 50)

    def refused(self, model, word):
        with self.assertLogs("pyomo", "ERROR") as logs, self.assertRaises(ApplicationError):
            solve(model, wantsol=1)
        text = "\n".join(logs.output)
        self.assertIn("MPEC", text)
        self.assertIn(word, text)

    def test_what_is_not_supported_is_refused(self):
        m = self.market()
        m.limit = Constraint(expr=m.x + m.y <= 100)
        self.refused(m, "lower-level variables")
        m = self.market()
        m.o.set_value(abs(m.x - 3) + m.y)
        self.refused(m, "kinks")
        m = self.market()
        m.w = Var(bounds=(0, 1))
        m.e = Constraint(expr=m.w + m.x == 3)
        m.o.set_value(m.x + m.y + m.w)
        self.refused(m, "upper-level")


if __name__ == "__main__":
    unittest.main()
