"""Models as a user of Pyomo writes them, solved by the program `semismooth` on the PATH.

Each test compares with a known solution (a closed form or a published point), or checks the conditions themselves, evaluated by Pyomo at
the returned values. Run: python models.py (with pyomo installed and the program's folder in PATH).
"""

import logging
import math
import unittest

import pyomo.environ as pyo
from pyomo.common.errors import ApplicationError
from pyomo.environ import ConcreteModel, Constraint, Objective, Var, value
from pyomo.mpec import Complementarity, complements

TOLERANCE = 1e-6


def solve(model, **options):
    solver = pyo.SolverFactory("asl:semismooth")
    for name, setting in options.items():
        solver.options[name] = setting
    return solver.solve(model, load_solutions=False)


def code(results):
    """AMPL's solve_result_num."""
    return results.solver.id


class Case(unittest.TestCase):
    def solved(self, model, **options):
        results = solve(model, **options)
        self.assertEqual(code(results), 0, results.solver.message)
        model.solutions.load_from(results)
        return results

    def near(self, found, expected, tolerance=TOLERANCE):
        self.assertLessEqual(abs(value(found) - expected), tolerance * (1 + abs(expected)))

    def all_near(self, found, expected, tolerance=TOLERANCE):
        for one, other in zip(found, expected, strict=True):
            self.near(one, other, tolerance)

    def complementary(self, pairs, tolerance=1e-7):
        """0 <= x complements F >= 0 for pairs of both."""
        for x, f in pairs:
            x, f = value(x), value(f)
            self.assertGreaterEqual(x, -tolerance)
            self.assertGreaterEqual(f, -tolerance)
            self.assertLessEqual(min(x, f), tolerance)


def ncp(functions, start, names="x", upper=None):
    """0 <= x complements F(x) >= 0 for a list of functions of x."""
    m = ConcreteModel()
    n = len(functions)
    m.x = Var(range(n), bounds=(0, upper), initialize=dict(enumerate(start)))
    m.c = Complementarity(range(n), rule=lambda m, i: complements(m.x[i] >= 0, functions[i](m.x) >= 0))
    return m


class Classics(Case):
    def test_one_variable(self):
        m = ncp([lambda x: x[0] ** 2 - 2], [1.0])
        self.solved(m)
        self.near(m.x[0], math.sqrt(2))

    def test_bound_is_active(self):
        m = ncp([lambda x: x[0] + 3], [1.0])
        self.solved(m)
        self.assertEqual(value(m.x[0]), 0.0)

    def test_billups(self):
        """Newton's method stops near 0, where the merit function has a local minimum (Billups 1995)."""
        m = ncp([lambda x: (x[0] - 1) ** 2 - 1.01], [0.0])
        self.solved(m)
        self.near(m.x[0], 1 + math.sqrt(1.01))

    def kojima_shindo(self, start):
        f = [
            lambda x: 3 * x[0] ** 2 + 2 * x[0] * x[1] + 2 * x[1] ** 2 + x[2] + 3 * x[3] - 6,
            lambda x: 2 * x[0] ** 2 + x[0] + x[1] ** 2 + 10 * x[2] + 2 * x[3] - 2,
            lambda x: 3 * x[0] ** 2 + x[0] * x[1] + 2 * x[1] ** 2 + 2 * x[2] + 9 * x[3] - 9,
            lambda x: x[0] ** 2 + 3 * x[1] ** 2 + 2 * x[2] + 3 * x[3] - 3,
        ]
        m = ncp(f, start)
        self.solved(m)
        self.complementary((m.x[i], f[i](m.x)) for i in range(4))
        found = [value(m.x[i]) for i in range(4)]
        known = [(math.sqrt(6) / 2, 0, 0, 0.5), (1, 0, 3, 0)]
        distances = [max(abs(a - b) for a, b in zip(found, k)) for k in known]
        self.assertLess(min(distances), 1e-6)

    def test_kojima_shindo_from_zero(self):
        self.kojima_shindo([0, 0, 0, 0])

    def test_kojima_shindo_from_far(self):
        self.kojima_shindo([10, 10, 10, 10])

    def test_josephy(self):
        f = [
            lambda x: 3 * x[0] ** 2 + 2 * x[0] * x[1] + 2 * x[1] ** 2 + x[2] + 3 * x[3] - 6,
            lambda x: 2 * x[0] ** 2 + x[0] + x[1] ** 2 + 3 * x[2] + 2 * x[3] - 2,
            lambda x: 3 * x[0] ** 2 + x[0] * x[1] + 2 * x[1] ** 2 + 2 * x[2] + 3 * x[3] - 1,
            lambda x: x[0] ** 2 + 3 * x[1] ** 2 + 2 * x[2] + 3 * x[3] - 3,
        ]
        m = ncp(f, [0, 0, 0, 0])
        self.solved(m)
        self.all_near((m.x[i] for i in range(4)), (math.sqrt(6) / 2, 0, 0, 0.5))

    def test_mathiesen(self):
        """Prices of a Walrasian equilibrium (Mathiesen 1987)."""
        f = [
            lambda x: -x[1] + x[2] + x[3],
            lambda x: x[0] - (4.5 * x[2] + 2.7 * x[3]) / (x[1] + 1),
            lambda x: 5 - x[0] - (0.5 * x[2] + 0.3 * x[3]) / (x[2] + 1),
            lambda x: 3 - x[0],
        ]
        m = ncp(f, [1, 1, 1, 1])
        self.solved(m)
        self.complementary((m.x[i], f[i](m.x)) for i in range(4))

    def test_murty_lcp(self):
        """Pivoting takes 2^n steps (Murty 1988); solution (0, …, 0, 1)."""
        n = 12
        f = [lambda x, i=i: x[i] + 2 * sum(x[j] for j in range(i + 1, n)) - 1 for i in range(n)]
        m = ncp(f, [0] * n)
        self.solved(m)
        self.all_near((m.x[i] for i in range(n)), [0.0] * (n - 1) + [1.0])

    def test_fathi_lcp(self):
        n = 8

        def entry(i, j):
            return 4 * min(i, j) + 1 if i == j else 4 * min(i, j) + 2

        f = [lambda x, i=i: sum(entry(i, j) * x[j] for j in range(n)) - 1 for i in range(n)]
        m = ncp(f, [0] * n)
        self.solved(m)
        self.all_near((m.x[i] for i in range(n)), [1.0] + [0.0] * (n - 1))

    def test_no_solution(self):
        """x0 >= 0 complements -1 >= 0 has none; it is proven."""
        m = ncp([lambda x: x[1] - x[0] - 1, lambda x: -x[1] - 1 + 0 * x[0]], [0, 0])
        results = solve(m)
        self.assertEqual(code(results), 200, results.solver.message)
        self.assertEqual(results.solver.termination_condition, pyo.TerminationCondition.infeasible)

    def test_no_solution_that_is_not_proven(self):
        m = ncp([lambda x: -pyo.exp(-x[0])], [0.0])
        results = solve(m)
        self.assertGreaterEqual(code(results), 400)
        self.assertNotIn("Solved", results.solver.message)

    def test_iteration_limit(self):
        m = ncp([lambda x: x[0] ** 3 - 1000], [1.0])
        self.assertEqual(code(solve(m, max_iter=1)), 400)


class Forms(Case):
    """All forms of a complementarity condition in Pyomo."""

    def test_both_sides_are_expressions(self):
        m = ConcreteModel()
        m.x = Var(initialize=1)
        m.y = Var(initialize=1)
        m.c = Complementarity(expr=complements(m.x + m.y >= 1, m.x - 2 * m.y >= -3))
        m.e = Constraint(expr=m.x == 2 * m.y**2)
        self.solved(m)
        a, b = value(m.x + m.y - 1), value(m.x - 2 * m.y + 3)
        self.assertLessEqual(abs(min(a, b)), 1e-7)
        self.near(m.x, 2 * value(m.y) ** 2)

    def test_upper_bounds(self):
        """x <= 2 complements x + 1 <= 4: the first holds with equality, F = x − 3 ≤ 0."""
        m = ConcreteModel()
        m.x = Var(initialize=0)
        m.c = Complementarity(expr=complements(m.x <= 2, m.x + 1 <= 4))
        self.solved(m)
        self.near(m.x, 2)

    def test_lower_and_upper_side(self):
        """x >= 1 complements exp(x) <= 20."""
        m = ConcreteModel()
        m.x = Var(initialize=1.5)
        m.c = Complementarity(expr=complements(m.x >= 1, pyo.exp(m.x) <= 20))
        self.solved(m)
        self.assertLessEqual(min(abs(value(m.x) - 1), abs(value(m.x) - math.log(20))), 1e-6)

    def test_equation_in_a_condition(self):
        m = ConcreteModel()
        m.x = Var(initialize=1)
        m.c = Complementarity(expr=complements(m.x**3 == 8, m.x >= 0))
        self.solved(m)
        self.near(m.x, 2)

    def test_interval(self):
        """l <= x <= u complements F, by the multipliers of both bounds (Pyomo cannot write the condition itself)."""
        for target, expected in ((5, 2), (-7, -1), (0.5, 0.5)):
            m = ConcreteModel()
            m.x = Var(initialize=0)
            m.low = Var(bounds=(0, None))
            m.high = Var(bounds=(0, None))
            m.e = Constraint(expr=m.x - target == m.low - m.high)
            m.at_low = Complementarity(expr=complements(m.low >= 0, m.x >= -1))
            m.at_high = Complementarity(expr=complements(m.high >= 0, m.x <= 2))
            self.solved(m)
            self.near(m.x, expected)

    def test_bound_that_no_condition_names(self):
        """0 <= x complements x − 3 >= 0 with the bound x <= 2 in addition: no solution, and none is claimed."""
        m = ncp([lambda x: x[0] - 3], [1.0], upper=2)
        results = solve(m)
        self.assertEqual(code(results), 100, results.solver.message)
        self.assertEqual(results.solver.status, pyo.SolverStatus.warning)
        self.assertIn("doubt", results.solver.message)

    def test_bound_that_no_condition_names_and_that_is_kept(self):
        m = ncp([lambda x: x[0] - 3], [1.0], upper=4)
        self.solved(m)
        self.near(m.x[0], 3)

    def test_blocks(self):
        m = ConcreteModel()

        def fill(b, i):
            b.x = Var(bounds=(0, None), initialize=1)
            b.c = Complementarity(expr=complements(b.x >= 0, b.x**2 + b.x >= i - 3))

        m.b = pyo.Block([1, 2, 5, 9], rule=fill)
        self.solved(m)
        self.all_near((m.b[i].x for i in (1, 2, 5, 9)), [0, 0, 1, (-1 + math.sqrt(25)) / 2])

    def test_equations_beside(self):
        """x ⟂ F with F = price of a market that clears."""
        m = ConcreteModel()
        m.price = Var(initialize=1)
        m.quantity = Var(bounds=(0, None), initialize=1)
        m.demand = Constraint(expr=m.quantity * m.price**2 == 10)
        m.supply = Complementarity(expr=complements(m.quantity >= 0, 1 + m.quantity**0.5 >= m.price))
        self.solved(m)
        q = value(m.quantity)
        self.near(m.price, 1 + math.sqrt(q))
        self.near(q * (1 + math.sqrt(q)) ** 2, 10)

    def test_inactive_conditions_and_fixed_variables(self):
        m = ConcreteModel()
        m.x = Var(range(3), bounds=(0, None), initialize=1)
        m.x[2].fix(4)
        m.c = Complementarity(range(2), rule=lambda m, i: complements(m.x[i] >= 0, m.x[i] * m.x[2] >= 2 + i))
        m.off = Complementarity(expr=complements(m.x[0] >= 7, m.x[1] >= 9))
        m.off.deactivate()
        self.solved(m)
        self.all_near((m.x[0], m.x[1]), (0.5, 0.75))

    def test_too_few_conditions(self):
        m = ncp([lambda x: x[0] - 1], [0])
        m.y = Var()
        m.z = Var()
        m.e = Constraint(expr=m.y + m.z == 1)
        logging.disable(logging.CRITICAL)
        with self.assertRaises(ApplicationError):
            solve(m)
        logging.disable(logging.NOTSET)

    def test_operators(self):
        """Each function that Pyomo can write, in one equation each."""
        m = ConcreteModel()
        functions = {
            "log10": (pyo.log10, 2.0),
            "log": (pyo.log, 2.0),
            "exp": (pyo.exp, 0.5),
            "sqrt": (pyo.sqrt, 2.0),
            "sin": (pyo.sin, 0.5),
            "cos": (pyo.cos, 0.5),
            "tan": (pyo.tan, 0.5),
            "asin": (pyo.asin, 0.4),
            "acos": (pyo.acos, 0.4),
            "atan": (pyo.atan, 0.4),
            "sinh": (pyo.sinh, 0.4),
            "cosh": (pyo.cosh, 0.4),
            "tanh": (pyo.tanh, 0.4),
            "asinh": (pyo.asinh, 0.4),
            "acosh": (pyo.acosh, 1.4),
            "atanh": (pyo.atanh, 0.4),
            "abs": (abs, -0.7),
            "power": (lambda x: x**2.5, 1.3),
            "base": (lambda x: 3**x, 0.3),
            "both": (lambda x: x**x, 1.3),
            "if": (lambda x: pyo.Expr_if(IF=x >= 1, THEN=x**2, ELSE=2 * x - 1), 1.7),
        }
        m.x = Var(list(functions), initialize={k: p * 1.05 for k, (_, p) in functions.items()})
        m.e = Constraint(
            list(functions), rule=lambda m, k: functions[k][0](m.x[k]) == value(functions[k][0](functions[k][1]))
        )
        self.solved(m)
        for name, (_, point) in functions.items():
            self.near(m.x[name], point)


class Equilibria(Case):
    def test_cournot_nash(self):
        """Five firms (Murphy, Sherali and Soyster 1982; Harker 1984)."""
        costs, beta, elasticity = [10, 8, 6, 4, 2], [1.2, 1.1, 1.0, 0.9, 0.8], 1.1

        def marginal(x, i):
            total = sum(x[k] for k in range(5))
            price = (5000 / total) ** (1 / elasticity)
            return costs[i] + (x[i] / 5) ** (1 / beta[i]) - price + x[i] * price / (total * elasticity)

        m = ncp([lambda x, i=i: marginal(x, i) for i in range(5)], [10.0] * 5)
        self.solved(m)
        self.all_near((m.x[i] for i in range(5)), (36.9325, 41.8181, 43.7066, 42.6592, 39.1790), 1e-5)

    def test_spatial_prices(self):
        supply = [(2.0, 0.10), (4.0, 0.05), (9.0, 0.20)]
        demand = [(25.0, 0.20), (18.0, 0.10), (15.0, 0.40)]
        cost = [[1.0, 2.0, 3.0], [2.0, 1.5, 2.5], [4.0, 2.5, 0.5]]
        m = ConcreteModel()
        arcs = [(i, j) for i in range(3) for j in range(3)]
        m.x = Var(arcs, bounds=(0, None))

        def loss(m, i, j):
            out = sum(m.x[i, k] for k in range(3))
            into = sum(m.x[k, j] for k in range(3))
            a, b = supply[i], demand[j]
            return a[0] + a[1] * out + cost[i][j] + 0.01 * m.x[i, j] - (b[0] - b[1] * into)

        m.c = Complementarity(arcs, rule=lambda m, i, j: complements(m.x[i, j] >= 0, loss(m, i, j) >= 0))
        self.solved(m)
        self.complementary((m.x[a], loss(m, *a)) for a in arcs)
        self.assertGreater(sum(value(m.x[a]) for a in arcs), 10)

    def braess(self, routes):
        uses = [(0, 2), (1, 3), (0, 4, 3)][:routes]
        links = [(0, 10), (50, 1), (50, 1), (0, 10), (10, 1)]
        m = ConcreteModel()
        m.flow = Var(range(routes), bounds=(0, None), initialize=1)
        m.time = Var(initialize=1)

        def link(m, k):
            load = sum(m.flow[r] for r in range(routes) if k in uses[r])
            return links[k][0] + links[k][1] * load

        m.wardrop = Complementarity(
            range(routes), rule=lambda m, r: complements(m.flow[r] >= 0, sum(link(m, k) for k in uses[r]) >= m.time)
        )
        m.all = Constraint(expr=sum(m.flow[r] for r in range(routes)) == 6)
        self.solved(m)
        return value(m.time)

    def test_braess_before_and_after(self):
        """The new road increases all travel times: 83 and 92 minutes (Braess 1968)."""
        self.near(self.braess(2), 83)
        self.near(self.braess(3), 92)

    def test_walras(self):
        """Two goods, two consumers with Cobb–Douglas utilities: prices in closed form, the sum of prices 1."""
        shares, endowments = [0.3, 0.6], [(4.0, 1.0), (2.0, 5.0)]
        m = ConcreteModel()
        m.p = Var(range(2), bounds=(0, None), initialize=0.5)
        m.income = Var(range(2), initialize=1)
        m.budget = Constraint(
            range(2), rule=lambda m, k: m.income[k] == sum(m.p[i] * endowments[k][i] for i in range(2))
        )
        m.clears = Complementarity(
            expr=complements(m.p[0] >= 0, 6 * m.p[0] >= sum(shares[k] * m.income[k] for k in range(2)))
        )
        m.numeraire = Constraint(expr=m.p[0] + m.p[1] == 1)
        self.solved(m)
        # 6 p = 0.3 (4 p + q) + 0.6 (2 p + 5 q) with p + q = 1.
        self.near(m.p[0], 3.3 / (6 - 2.4 + 3.3))

    def bimatrix(self, a, b):
        """x ⟂ A y − 1, y ⟂ Bᵀ x − 1 with costs A, B > 0; x and y divided by their sums are an equilibrium."""
        rows, cols = len(a), len(a[0])
        m = ConcreteModel()
        m.x = Var(range(rows), bounds=(0, None), initialize=0.1)
        m.y = Var(range(cols), bounds=(0, None), initialize=0.1)
        m.first = Complementarity(
            range(rows), rule=lambda m, i: complements(m.x[i] >= 0, sum(a[i][j] * m.y[j] for j in range(cols)) >= 1)
        )
        m.second = Complementarity(
            range(cols), rule=lambda m, j: complements(m.y[j] >= 0, sum(b[i][j] * m.x[i] for i in range(rows)) >= 1)
        )
        self.solved(m)
        x = [value(m.x[i]) for i in range(rows)]
        y = [value(m.y[j]) for j in range(cols)]
        x, y = [v / sum(x) for v in x], [v / sum(y) for v in y]
        costs = [sum(a[i][j] * y[j] for j in range(cols)) for i in range(rows)]
        others = [sum(b[i][j] * x[i] for i in range(rows)) for j in range(cols)]
        self.near(sum(p * c for p, c in zip(x, costs)), min(costs))
        self.near(sum(p * c for p, c in zip(y, others)), min(others))
        return x, y

    def test_battle_of_the_sexes(self):
        self.bimatrix([[1, 4], [4, 2]], [[2, 4], [4, 1]])

    def test_matching_pennies(self):
        x, y = self.bimatrix([[1, 2], [2, 1]], [[2, 1], [1, 2]])
        self.all_near(x + y, [0.5] * 4)

    def test_rock_paper_scissors(self):
        a = [[2, 3, 1], [1, 2, 3], [3, 1, 2]]
        b = [[4 - v for v in row] for row in a]
        x, y = self.bimatrix(a, b)
        self.all_near(x + y, [1 / 3] * 6)

    def test_transport_of_kuhn(self):
        """First-order conditions of a linear program, written by hand: the dual prices of Dantzig's transport problem."""
        plants, markets = {"seattle": 350, "sandiego": 600}, {"newyork": 325, "chicago": 300, "topeka": 275}
        distance = {
            ("seattle", "newyork"): 2.5,
            ("seattle", "chicago"): 1.7,
            ("seattle", "topeka"): 1.8,
            ("sandiego", "newyork"): 2.5,
            ("sandiego", "chicago"): 1.8,
            ("sandiego", "topeka"): 1.4,
        }
        m = ConcreteModel()
        m.x = Var(plants, markets, bounds=(0, None))
        m.w = Var(plants, bounds=(0, None))
        m.p = Var(markets, bounds=(0, None))
        m.profit = Complementarity(
            plants, markets, rule=lambda m, i, j: complements(m.x[i, j] >= 0, m.w[i] + 0.09 * distance[i, j] >= m.p[j])
        )
        m.supply = Complementarity(
            plants, rule=lambda m, i: complements(m.w[i] >= 0, sum(m.x[i, j] for j in markets) <= plants[i])
        )
        m.demand = Complementarity(
            markets, rule=lambda m, j: complements(m.p[j] >= 0, sum(m.x[i, j] for i in plants) >= markets[j])
        )
        self.solved(m)
        self.near(sum(0.09 * distance[a] * value(m.x[a]) for a in distance), 153.675)


class Grids(Case):
    def test_obstacle(self):
        """A membrane over a bump: −Δu ≥ f ⟂ u ≥ ψ, on a grid of 20 × 20."""
        n = 20
        h = 1 / (n + 1)
        grid = [(i, j) for i in range(1, n + 1) for j in range(1, n + 1)]

        def bump(i, j):
            return 0.5 - 4 * ((i * h - 0.5) ** 2 + (j * h - 0.5) ** 2)

        m = ConcreteModel()
        m.u = Var(grid, initialize=0)

        def at(m, i, j):
            return m.u[i, j] if (i, j) in grid_set else 0

        grid_set = set(grid)

        def force(m, i, j):
            near = at(m, i - 1, j) + at(m, i + 1, j) + at(m, i, j - 1) + at(m, i, j + 1)
            return 4 * m.u[i, j] - near

        m.c = Complementarity(grid, rule=lambda m, i, j: complements(m.u[i, j] >= bump(i, j), force(m, i, j) >= 0))
        self.solved(m)
        self.complementary((value(m.u[p]) - bump(*p), force(m, *p)) for p in grid)
        contact = sum(abs(value(m.u[p]) - bump(*p)) < 1e-9 for p in grid)
        self.assertTrue(0 < contact < n * n / 2)
        for i, j in grid:
            self.near(m.u[i, j], value(m.u[j, i]))

    def test_american_put(self):
        """One implicit step after the other of an option that may be exercised early: never below its payoff."""
        n, steps, strike, rate, vol = 40, 4, 1.0, 0.1, 0.4
        ds, dt = 3.0 / n, 0.25
        payoff = [max(strike - i * ds, 0) for i in range(n + 1)]
        m = ConcreteModel()
        m.v = Var(range(steps + 1), range(n + 1), initialize=0)
        m.start = Constraint(range(n + 1), rule=lambda m, i: m.v[0, i] == payoff[i])
        m.left = Constraint(range(1, steps + 1), rule=lambda m, k: m.v[k, 0] == payoff[0])
        m.right = Constraint(range(1, steps + 1), rule=lambda m, k: m.v[k, n] == 0)

        def hold(m, k, i):
            a = 0.5 * vol**2 * i**2
            drift = 0.5 * rate * i
            v = m.v
            generator = (
                a * (v[k, i + 1] - 2 * v[k, i] + v[k, i - 1]) + drift * (v[k, i + 1] - v[k, i - 1]) - rate * v[k, i]
            )
            return v[k, i] - v[k - 1, i] - dt * generator

        inner = [(k, i) for k in range(1, steps + 1) for i in range(1, n)]
        m.c = Complementarity(inner, rule=lambda m, k, i: complements(m.v[k, i] >= payoff[i], hold(m, k, i) >= 0))
        self.solved(m)
        self.complementary((value(m.v[p]) - payoff[p[1]], hold(m, *p)) for p in inner)

    def test_control_with_hundred_states(self):
        """A nonlinear boundary value problem with one obstacle: sparse, 100 unknowns, from 0."""
        n = 100
        h = 1 / (n + 1)
        m = ConcreteModel()
        m.u = Var(range(n + 2), initialize=0)
        m.a = Constraint(expr=m.u[0] == 0)
        m.b = Constraint(expr=m.u[n + 1] == 0)

        def residual(m, i):
            return (2 * m.u[i] - m.u[i - 1] - m.u[i + 1]) / h**2 + pyo.exp(m.u[i]) + 10

        m.c = Complementarity(range(1, n + 1), rule=lambda m, i: complements(m.u[i] >= -0.4, residual(m, i) >= 0))
        self.solved(m)
        self.complementary(((value(m.u[i]) + 0.4) / h**2, residual(m, i)) for i in range(1, n + 1))
        self.assertTrue(any(value(m.u[i]) == -0.4 for i in range(n)))


class Programs(Case):
    """First-order conditions of programs. Known minima are reached from these starts; the program claims only the conditions."""

    def stationary(self, m, expected, **options):
        m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
        results = self.solved(m, **options)
        self.assertIn("KKT point", results.solver.message)
        self.assertNotIn("no local", results.solver.message)
        objective = next(m.component_data_objects(Objective, active=True))
        self.near(objective, expected)
        return results

    def variables(self, start, bounds=(None, None)):
        m = ConcreteModel()
        m.x = Var(range(1, len(start) + 1), initialize=dict(enumerate(start, 1)), bounds=bounds)
        return m

    def test_hs1(self):
        m = self.variables([-2, 1])
        m.x[2].setlb(-1.5)
        m.o = Objective(expr=100 * (m.x[2] - m.x[1] ** 2) ** 2 + (1 - m.x[1]) ** 2)
        self.stationary(m, 0)

    def test_hs3(self):
        m = self.variables([10, 1])
        m.x[2].setlb(0)
        m.o = Objective(expr=m.x[2] + 1e-5 * (m.x[2] - m.x[1]) ** 2)
        self.stationary(m, 0)

    def test_hs4(self):
        m = self.variables([1.125, 0.125])
        m.x[1].setlb(1)
        m.x[2].setlb(0)
        m.o = Objective(expr=(m.x[1] + 1) ** 3 / 3 + m.x[2])
        self.stationary(m, 8 / 3)

    def test_hs6(self):
        m = self.variables([-1.2, 1])
        m.o = Objective(expr=(1 - m.x[1]) ** 2)
        m.c = Constraint(expr=10 * (m.x[2] - m.x[1] ** 2) == 0)
        self.stationary(m, 0)

    def test_hs7(self):
        m = self.variables([2, 2])
        m.o = Objective(expr=pyo.log(1 + m.x[1] ** 2) - m.x[2])
        m.c = Constraint(expr=(1 + m.x[1] ** 2) ** 2 + m.x[2] ** 2 == 4)
        self.stationary(m, -math.sqrt(3))

    def test_hs21(self):
        m = self.variables([-1, -1])
        m.x[1].setlb(2), m.x[1].setub(50), m.x[2].setlb(-50), m.x[2].setub(50)
        m.o = Objective(expr=0.01 * m.x[1] ** 2 + m.x[2] ** 2 - 100)
        m.c = Constraint(expr=10 * m.x[1] - m.x[2] >= 10)
        self.stationary(m, -99.96)

    def test_hs28(self):
        m = self.variables([-4, 1, 1])
        m.o = Objective(expr=(m.x[1] + m.x[2]) ** 2 + (m.x[2] + m.x[3]) ** 2)
        m.c = Constraint(expr=m.x[1] + 2 * m.x[2] + 3 * m.x[3] == 1)
        self.stationary(m, 0)

    def test_hs35(self):
        """Beale's problem, with the multiplier of its constraint: 2/9, negative for ≤ in AMPL's sign."""
        m = self.variables([0.5, 0.5, 0.5], (0, None))
        x = m.x
        m.o = Objective(
            expr=9
            - 8 * x[1]
            - 6 * x[2]
            - 4 * x[3]
            + 2 * x[1] ** 2
            + 2 * x[2] ** 2
            + x[3] ** 2
            + 2 * x[1] * x[2]
            + 2 * x[1] * x[3]
        )
        m.c = Constraint(expr=x[1] + x[2] + 2 * x[3] <= 3)
        self.stationary(m, 1 / 9)
        self.near(m.dual[m.c], -2 / 9)

    def test_hs43(self):
        """Rosen and Suzuki."""
        m = self.variables([0, 0, 0, 0])
        x = m.x
        m.o = Objective(
            expr=x[1] ** 2 + x[2] ** 2 + 2 * x[3] ** 2 + x[4] ** 2 - 5 * x[1] - 5 * x[2] - 21 * x[3] + 7 * x[4]
        )
        m.c1 = Constraint(expr=8 - x[1] ** 2 - x[2] ** 2 - x[3] ** 2 - x[4] ** 2 - x[1] + x[2] - x[3] + x[4] >= 0)
        m.c2 = Constraint(expr=10 - x[1] ** 2 - 2 * x[2] ** 2 - x[3] ** 2 - 2 * x[4] ** 2 + x[1] + x[4] >= 0)
        m.c3 = Constraint(expr=5 - 2 * x[1] ** 2 - x[2] ** 2 - x[3] ** 2 - 2 * x[1] + x[2] + x[4] >= 0)
        self.stationary(m, -44)
        self.all_near((x[i] for i in range(1, 5)), (0, 1, 2, -1))
        self.all_near((m.dual[c] for c in (m.c1, m.c2, m.c3)), (1, 0, 2))

    def test_hs71(self):
        m = self.variables([1, 5, 5, 1], (1, 5))
        x = m.x
        m.o = Objective(expr=x[1] * x[4] * (x[1] + x[2] + x[3]) + x[3])
        m.c1 = Constraint(expr=x[1] * x[2] * x[3] * x[4] >= 25)
        m.c2 = Constraint(expr=sum(x[i] ** 2 for i in range(1, 5)) == 40)
        self.stationary(m, 17.0140173)
        self.near(m.dual[m.c1], 0.5522937, 1e-5)
        self.near(m.dual[m.c2], -0.1614686, 1e-5)

    def test_maximum_with_ranges(self):
        """max x y with 1 ≤ x + y ≤ 2: 1, and one more unit of x + y is worth 1."""
        m = self.variables([0.5, 0.7])
        m.o = Objective(expr=m.x[1] * m.x[2], sense=pyo.maximize)
        m.c = Constraint(expr=pyo.inequality(1, m.x[1] + m.x[2], 2))
        self.stationary(m, 1)
        self.near(m.dual[m.c], 1)

    def test_linear_program(self):
        m = self.variables([0, 0], (0, None))
        m.o = Objective(expr=3 * m.x[1] + 5 * m.x[2], sense=pyo.maximize)
        m.c = Constraint(
            [1, 2, 3], rule=lambda m, i: [m.x[1] <= 4, 2 * m.x[2] <= 12, 3 * m.x[1] + 2 * m.x[2] <= 18][i - 1]
        )
        self.stationary(m, 36)
        self.all_near((m.dual[m.c[i]] for i in (1, 2, 3)), (0, 1.5, 1))

    def test_shared_expressions(self):
        """Named expressions become defined variables."""
        m = self.variables([0.5, 0.5, 0.5])
        m.s = pyo.Expression(expr=m.x[1] ** 2 + pyo.sin(m.x[2]) * m.x[3])
        m.t = pyo.Expression(expr=m.s**2 + m.s)
        m.o = Objective(expr=m.t + (m.x[1] - 1) ** 2 + (m.x[2] - 1) ** 2 + m.x[3] ** 2)
        m.c = Constraint(expr=m.t * m.x[2] >= 1)
        m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
        self.solved(m)
        # The gradient of the Lagrangian, by differences of Pyomo's own values.
        y = m.dual[m.c]
        for i in (1, 2, 3):
            at, h = value(m.x[i]), 1e-5
            m.x[i].set_value(at + h)
            above = value(m.o) - y * value(m.t * m.x[2])
            m.x[i].set_value(at - h)
            below = value(m.o) - y * value(m.t * m.x[2])
            m.x[i].set_value(at)
            self.assertLess(abs(above - below) / (2 * h), 1e-6)
        self.assertGreaterEqual(value(m.t * m.x[2]), 1 - 1e-8)

    def test_chained_rosenbrock(self):
        """A sparse Hessian of 200 variables (CUTE's CHNROSNB with unit weights)."""
        n = 200
        m = self.variables([-1.0] * n)
        m.o = Objective(expr=sum((m.x[i] - m.x[i + 1] ** 2) ** 2 + (m.x[i + 1] - 1) ** 2 for i in range(1, n)))
        self.solved(m)
        self.near(m.o, 0)

    def test_unbounded_programs(self):
        m = self.variables([1], (0, None))
        m.o = Objective(expr=-m.x[1])
        self.assertEqual(code(solve(m)), 300)
        m = self.variables([1, 1], (0, None))
        m.o = Objective(expr=m.x[1] ** 2 + 3 * m.x[2], sense=pyo.maximize)
        m.c = Constraint(expr=pyo.inequality(1, m.x[1] - m.x[2], 2))
        self.assertEqual(code(solve(m)), 300)

    def test_infeasible_programs(self):
        for m, o in (
            (self.variables([1, 1], (0, None)), lambda x: x[1] ** 2 + x[2]),
            (self.variables([3, 3], (0, None)), lambda x: -x[1]),
        ):
            m.o = Objective(expr=o(m.x))
            m.c = Constraint(expr=m.x[1] + m.x[2] <= -1)
            self.assertEqual(code(solve(m)), 200)

    def test_square_system(self):
        """No objective, as many equations as variables; bounds keep the logarithm where it is defined."""
        m = self.variables([1, 1], (1e-6, None))
        m.c = Constraint([1, 2], rule=lambda m, i: [pyo.log(m.x[1]) + m.x[2] == 3, m.x[1] * m.x[2] == 5][i - 1])
        self.solved(m)
        self.near(math.log(value(m.x[1])) + value(m.x[2]), 3)

    def test_square_system_without_a_solution_in_the_bounds(self):
        m = self.variables([1], (2, None))
        m.c = Constraint(expr=m.x[1] ** 3 == 1)
        results = solve(m)
        self.assertEqual(code(results), 500, results.solver.message)


if __name__ == "__main__":
    unittest.main()
