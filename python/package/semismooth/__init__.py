"""Piecewise-smooth equations and complementarity problems: solve them, follow their curves of solutions through every kink, list all their
solutions.

A problem is a Python function, run once on traced variables (:func:`trace`); its kinks are written with :func:`maximum`, :func:`minimum`,
``abs``, :func:`clip` and :func:`where`. Afterwards no Python runs, derivatives are exact, and the pieces on both sides of every kink are
known. Arrays are numpy's; matrices may be those of scipy.sparse.

>>> import semismooth as ss
>>> result = ss.solve_lcp([[2.0, 1.0], [1.0, 2.0]], [-5.0, -1.0])
>>> result.status, result.x
('solved', array([2.5, 0. ]))
"""

from ._core import (
    Branch,
    BranchPoint,
    Condition,
    ConeResult,
    Continuum,
    Crossing,
    Diagram,
    Edge,
    Expression,
    Fold,
    FrictionResult,
    Lcp,
    LemkeResult,
    Map,
    McpResult,
    SemismoothError,
    Solution,
    SolutionSet,
    Transition,
    Vertex,
    ViResult,
    all_solutions,
    diagram,
    follow,
    lemke,
    solve_cone,
    solve_friction,
    solve_lcp,
    solve_mcp,
    solve_vi,
    trace,
)
from ._functions import clip, maximum, minimum, where

__all__ = [
    "Branch",
    "BranchPoint",
    "Condition",
    "ConeResult",
    "Continuum",
    "Crossing",
    "Diagram",
    "Edge",
    "Expression",
    "Fold",
    "FrictionResult",
    "Lcp",
    "LemkeResult",
    "Map",
    "McpResult",
    "SemismoothError",
    "Solution",
    "SolutionSet",
    "Transition",
    "Vertex",
    "ViResult",
    "all_solutions",
    "clip",
    "diagram",
    "follow",
    "lemke",
    "maximum",
    "minimum",
    "solve_cone",
    "solve_friction",
    "solve_lcp",
    "solve_mcp",
    "solve_vi",
    "trace",
    "where",
]
