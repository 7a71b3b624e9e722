"""The mixed complementarity problems of the crate's tests, from each of their starts, through Pyomo.

Run: python -m unittest collection (with pyomo installed and the program's folder in PATH).
"""

import json
import unittest
from functools import reduce
from operator import add, mul
from pathlib import Path

import pyomo.environ as pyo
from pyomo.environ import ConcreteModel, Constraint, Var, value
from pyomo.mpec import Complementarity, complements

FOLDER = Path(__file__).resolve().parents[3] / "tests" / "data" / "complementarity"
FUNCTIONS = {"exp": pyo.exp, "log": pyo.log, "sqrt": pyo.sqrt, "sin": pyo.sin, "cos": pyo.cos}


def expression(tree, m):
    """A tree of the file (for its format see examples/common/expressions.rs) as an expression of Pyomo."""
    if isinstance(tree, (int, float)):
        return tree
    head, *rest = tree
    if head == "v":
        return m.x[rest[0]]
    if head == "d":
        return m.d[rest[0]]
    if head == "lin":
        return rest[0] + sum(c * m.x[j] for j, c in zip(rest[1], rest[2]))
    if head == "^":
        return expression(rest[0], m) ** rest[1]
    operands = [expression(t, m) for t in rest]
    if head in FUNCTIONS:
        return FUNCTIONS[head](*operands)
    if head == "neg":
        return -operands[0]
    if head == "/":
        return operands[0] / operands[1]
    if head == "pow":
        return operands[0] ** operands[1]
    return reduce({"+": add, "*": mul}[head], operands)


def build(problem, start):
    """The model: an interval of two finite bounds by the multipliers of both, which is how Pyomo can write it."""
    m = ConcreteModel()
    indices = range(problem["n"])
    low, high = problem["lower"], problem["upper"]
    m.x = Var(indices, bounds=lambda m, i: (low[i], high[i]), initialize=dict(enumerate(start)))
    m.d = pyo.Expression(range(len(problem["defs"])))
    for k, tree in enumerate(problem["defs"]):
        m.d[k] = expression(tree, m)
    m.f = pyo.Expression(indices, rule=lambda m, i: expression(problem["rows"][i], m))
    both = [i for i in indices if low[i] is not None and high[i] is not None]
    m.below = Var(both, bounds=(0, None), initialize=0)
    m.above = Var(both, bounds=(0, None), initialize=0)

    def condition(b, i):
        if i in both:
            b.e = Constraint(expr=m.f[i] == m.below[i] - m.above[i])
            b.low = Complementarity(expr=complements(m.below[i] >= 0, m.x[i] >= low[i]))
            b.high = Complementarity(expr=complements(m.above[i] >= 0, m.x[i] <= high[i]))
        elif low[i] is not None:
            b.low = Complementarity(expr=complements(m.x[i] >= low[i], m.f[i] >= 0))
        elif high[i] is not None:
            b.high = Complementarity(expr=complements(m.x[i] <= high[i], m.f[i] <= 0))
        else:
            b.e = Constraint(expr=m.f[i] == 0)

    m.b = pyo.Block(indices, rule=condition)
    return m


def residual(problem, m):
    """max |x − mid(l, u, x − F)|, relative to 1 + |x|."""
    worst = 0.0
    for i in range(problem["n"]):
        x, f = value(m.x[i]), value(m.f[i])
        low = float("-inf") if problem["lower"][i] is None else problem["lower"][i]
        high = float("inf") if problem["upper"][i] is None else problem["upper"][i]
        worst = max(worst, abs(x - min(max(low, x - f), high)) / (1 + abs(x)))
    return worst


class Collection(unittest.TestCase):
    def test_every_problem_from_every_start(self):
        files = sorted(FOLDER.glob("*.json"))
        self.assertGreater(len(files), 10)
        for path in files:
            problem = json.loads(path.read_text())
            for label, start in problem["starts"].items():
                with self.subTest(f"{problem['name']} from {label}"):
                    m = build(problem, start)
                    results = pyo.SolverFactory("asl:semismooth").solve(m, load_solutions=False)
                    self.assertEqual(results.solver.id == 0, problem["expect"] == "solution", results.solver.message)
                    if results.solver.id == 0:
                        m.solutions.load_from(results)
                        self.assertLess(residual(problem, m), 1e-6)


if __name__ == "__main__":
    unittest.main()
