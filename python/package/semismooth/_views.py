"""Tables and pictures of branches and diagrams, where pandas and matplotlib are installed."""

from collections.abc import Callable
from typing import Any

import numpy as np

#: Marker and size of each kind of event; steps have none.
_MARKERS = {
    "pass-through": ("o", 4),
    "fold": (">", 7),
    "smooth fold": ("D", 5),
    "vertical segment begins": ("v", 6),
    "vertical segment ends": ("^", 6),
    "vertical segment": ("v", 6),
    "branching": ("s", 6),
    "branch point": ("*", 9),
    "end": ("x", 7),
    "isolated": ("x", 7),
    "undecided": ("P", 7),
    "monitor": ("|", 9),
}


def branch_table(branch: Any) -> Any:
    import pandas

    points, pieces = branch.points, branch.pieces
    columns = {"arclength": branch.arclength}
    columns |= {f"x{i}": points[:, i] for i in range(points.shape[1] - 1)}
    columns |= {"parameter": branch.parameter, "event": branch.events}
    sites = len(pieces[0]) if pieces else 0
    columns |= {f"site{s}": [row[s] for row in pieces] for s in range(sites)}
    return pandas.DataFrame(columns)


def _values(points: Any, what: int | Callable[[Any], float]) -> Any:
    return np.array([what(p) for p in points]) if callable(what) else points[:, what]


def _axes(ax: Any) -> Any:
    if ax is None:
        from matplotlib import pyplot

        _, ax = pyplot.subplots()
    return ax


def _label(what: int | Callable[[Any], float]) -> str:
    if callable(what):
        return getattr(what, "__name__", "").replace("<lambda>", "")
    return "parameter" if what == -1 else f"x[{what}]"


def _finish(ax: Any, x: Any, y: Any) -> Any:
    ax.set_xlabel(ax.get_xlabel() or _label(x))
    ax.set_ylabel(ax.get_ylabel() or _label(y))
    if ax.get_legend_handles_labels()[0]:
        ax.legend()
    return ax


def _line(ax: Any, xs: Any, ys: Any, dashed: bool, style: dict[str, Any]) -> None:
    ax.plot(xs, ys, **({"linestyle": "--" if dashed else "-", "label": "_line"} | style))


def _marks(ax: Any, marks: list[tuple[str, float, float]], color: Any) -> None:
    known = set(ax.get_legend_handles_labels()[1])
    for kind in dict.fromkeys(k for k, _, _ in marks):
        marker, size = _MARKERS.get(kind, ("", 0))
        if marker:
            places = [(a, b) for k, a, b in marks if k == kind]
            label = "_" + kind if kind in known else kind
            ax.plot(*zip(*places), linestyle="", marker=marker, markersize=size, color=color, markerfacecolor="white", label=label)


def _segment_signs(signs: list[int | None], events: list[str]) -> list[int]:
    """The sign of the determinant between each point and the next: that of a regular end, else it follows from the segment before, as it
    changes at folds alone; 0 where nothing is known."""
    known = [b or a or 0 for a, b in zip(signs, signs[1:])]
    order = range(1, len(known))
    for here, there, between in [(k, k - 1, k) for k in order] + [(k - 1, k, k) for k in reversed(order)]:
        if not known[here] and events[between] in ("fold", "pass-through"):
            known[here] = -known[there] if events[between] == "fold" else known[there]
    return known


def plot_branch(branch: Any, ax: Any, x: Any, y: Any, style: dict[str, Any] | None) -> Any:
    ax, x, y = _axes(ax), -1 if x is None else x, 0 if y is None else y
    style = {"color": "C0"} | (style or {})
    xs, ys = _values(branch.points, x), _values(branch.points, y)
    dashed = [s < 0 for s in _segment_signs(branch.det_signs, branch.events)]
    start = 0
    for i in range(1, len(dashed) + 1):
        if i == len(dashed) or dashed[i] != dashed[start]:
            _line(ax, xs[start : i + 1], ys[start : i + 1], dashed[start], style)
            start = i
    _marks(ax, list(zip(branch.events, xs, ys)), style["color"])
    return _finish(ax, x, y)


def plot_diagram(diagram: Any, ax: Any, x: Any, y: Any, style: dict[str, Any] | None) -> Any:
    ax, x, y = _axes(ax), -1 if x is None else x, 0 if y is None else y
    style = {"color": "C0"} | (style or {})
    for edge in diagram.edges:
        dashed = bool(edge.det_signs) and max(edge.det_signs) < 0
        _line(ax, _values(edge.points, x), _values(edge.points, y), dashed, style)
    points = np.array([v.x for v in diagram.vertices])
    kinds = [v.kind for v in diagram.vertices]
    if len(points):
        _marks(ax, list(zip(kinds, _values(points, x), _values(points, y))), style["color"])
    smooth = [f.x for f in diagram.folds if f.kind == "smooth"]
    if smooth:
        points = np.array(smooth)
        _marks(ax, [("smooth fold", a, b) for a, b in zip(_values(points, x), _values(points, y))], style["color"])
    return _finish(ax, x, y)
