"""Tables and pictures of branches and diagrams, where pandas and matplotlib are installed. Colours and markers are those of the crate's
pictures (`Colour` and `Marker` in its module `output`)."""

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

#: Colours of combinations of pieces, in the order in which they are met.
_COLOURS = ("#0072b2", "#d55e00", "#1aa873", "#dd8fbd", "#555555")

#: The legend entry of each event.
_KINDS = {
    "pass-through": "transition",
    "fold": "fold",
    "smooth fold": "smooth fold",
    "vertical segment begins": "vertical segment",
    "vertical segment ends": "vertical segment",
    "vertical segment": "vertical segment",
    "branching": "branching",
    "branch point": "branching",
    "end": "end",
    "isolated": "isolated solution",
    "continuum": "branching",
    "undecided": "undecided",
    "start": "start",
}

#: The marker of each legend entry: matplotlib's name, its size, and how it is filled.
_MARKERS: dict[str, tuple[Any, float, str]] = {
    "transition": ("o", 7, "white"),
    "fold": ("^", 8, "white"),
    "smooth fold": ("s", 6.5, "white"),
    "vertical segment": ("D", 6.5, "white"),
    "branching": ("D", 6.5, "black"),
    "end": ("x", 7, "black"),
    "isolated solution": ("o", 5, "black"),
    "undecided": ("$\\otimes$", 9, "black"),
    "start": ((6, 2, 0), 9, "black"),
    "value": ("+", 8, "black"),
}

_Drawn = int | Callable[[Any], float]


def branch_table(branch: Any) -> Any:
    import pandas

    points, pieces = branch.points, branch.pieces
    columns = {"arclength": branch.arclength}
    columns |= {f"x{i}": points[:, i] for i in range(points.shape[1] - 1)}
    columns |= {"parameter": branch.parameter, "event": branch.events}
    sites = len(pieces[0]) if pieces else 0
    columns |= {f"site{s}": [row[s] for row in pieces] for s in range(sites)}
    return pandas.DataFrame(columns)


def diagram_table(diagram: Any) -> Any:
    import pandas

    names, *rows = csv.reader(io.StringIO(bytes(diagram._csv()).decode(), newline=""))
    columns = dict(zip(names, zip(*rows) if rows else [()] * len(names)))

    def numbers(name: str) -> list[float]:
        return [float(v) if v else np.nan for v in columns[name]]

    def integers(name: str) -> Any:
        return pandas.array([int(v) if v else pandas.NA for v in columns[name]], dtype="Int64")

    known = ["edge", "arclength", "parameter", "event", "det"]
    values = [name for name in names if name[0] == "x" and name[1:].isdigit()]
    table = {"edge": integers("edge"), "arclength": numbers("arclength")} | {name: numbers(name) for name in values}
    table |= {"parameter": numbers("parameter"), "event": columns["event"], "det": integers("det")}
    sites = [name for name in names if name not in known + values]
    return pandas.DataFrame(table | {f"site{s}": columns[name] for s, name in enumerate(sites)})


def _values(points: Any, what: _Drawn) -> Any:
    return np.array([what(p) for p in points]) if callable(what) else points[:, what]


def _rates(points: Any, tangents: Any, what: _Drawn, steps: Any) -> Any:
    """Rates of what is drawn along the tangents, for functions by one-sided difference quotients of second order over these steps."""
    if not callable(what):
        return tangents[:, what]
    at = [_values(points + (k * steps)[:, None] * tangents, what) for k in range(3)]
    return (4 * at[1] - 3 * at[0] - at[2]) / (2 * steps)


def _smooth(points: Any, departures: Any, arrivals: Any, x: _Drawn, y: _Drawn) -> Any:
    """A curve through points, shape (2, k): cubics with the tangents of the curve at their ends where it is bent, as in the pictures of the
    crate (`Curve` in its module `output`), in units of its extent."""
    corners = np.array([_values(points, x), _values(points, y)], dtype=float)
    extent = np.ptp(corners, axis=1)[:, None] if corners.size else 1.0
    unit = np.where(extent > 0, extent, 1.0)
    corners = corners / unit
    a, b = corners[:, :-1], corners[:, 1:]
    steps = 1e-4 * np.linalg.norm(np.diff(points, axis=0), axis=1)
    with np.errstate(all="ignore"):
        u = np.array([_rates(points[:-1], departures[:-1], what, steps) for what in (x, y)]) / unit
        v = np.array([_rates(points[1:], arrivals[1:], what, -steps) for what in (x, y)]) / unit
        u, v = u / np.linalg.norm(u, axis=0), v / np.linalg.norm(v, axis=0)
        chord = np.linalg.norm(b - a, axis=0)
        c = (b - a) / chord

        def cross(p: Any, q: Any) -> Any:
            return p[0] * q[1] - p[1] * q[0]

        # Parabolas are exact: control points at two thirds of the ways to the point where the tangents meet.
        ahead, behind = cross(c, v) / cross(u, v), cross(u, c) / cross(u, v)
        meet = (ahead > 0) & (behind > 0)
        p = a + chord / 3 * np.where(meet, 2 * np.minimum(ahead, 1), 1) * u
        q = b - chord / 3 * np.where(meet, 2 * np.minimum(behind, 1), 1) * v
        away = [np.abs(cross(d - a, c)) for d in (p, q)]
        bent = np.maximum(*away) > 1e-4
    t = np.linspace(0, 1, 17)[1:]
    parts = [corners[:, :1]]
    for k in range(a.shape[1]):
        ends = [c[:, [k]] for c in (a, p, q, b)]
        weights = [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3]
        parts.append(np.sum([w * c for w, c in zip(weights, ends)], axis=0) if bent[k] else ends[3])
    return np.hstack(parts) * unit


def _label(what: _Drawn) -> str:
    if callable(what):
        return getattr(what, "__name__", "").replace("<lambda>", "")
    return "parameter" if what == -1 else f"x[{what}]"


class _Picture:
    """Axes to which curves and marks are added, with one entry of the legend for each class of lines and kind of marks."""

    def __init__(self, ax: Any, x: _Drawn | None, y: _Drawn | None, style: dict[str, Any] | None) -> None:
        if ax is None:
            from matplotlib import pyplot

            _, ax = pyplot.subplots()
        self.ax, self.style = ax, {"linewidth": 2.0} | (style or {})
        self.x: _Drawn = -1 if x is None else x
        self.y: _Drawn = 0 if y is None else y
        self.named = set(ax.get_legend_handles_labels()[1])
        self.classes: list[tuple[str, ...]] = []

    def label(self, name: str) -> str:
        """The name for the legend, hidden by an underscore if it is there already."""
        known = name in self.named
        self.named.add(name)
        return "_" + name if known else name

    def line(self, points: Any, tangents: tuple[Any, Any], pieces: Sequence[str], negative: bool) -> None:
        # As in pictures of the crate, colours show the pieces where there are few sites.
        few = 0 < len(pieces) <= 2
        look = {"color": _COLOURS[0], "label": "_line"}
        if few and "color" not in self.style:
            if tuple(pieces) not in self.classes:
                self.classes.append(tuple(pieces))
            look["color"] = _COLOURS[self.classes.index(tuple(pieces)) % len(_COLOURS)]
            look["label"] = self.label(", ".join(pieces))
        style = look | {"linestyle": "--" if negative else "-"} | self.style
        self.ax.plot(*_smooth(points, *tangents, self.x, self.y), **style)

    def marks(self, marks: Iterable[tuple[str, Any]]) -> None:
        places: dict[str, list[Any]] = {}
        for event, point in marks:
            if event in _KINDS:
                places.setdefault(_KINDS[event], []).append(point)
        for kind, (marker, size, fill) in _MARKERS.items():
            if kind not in places:
                continue
            points = np.array(places[kind])
            look = {"color": "black", "markerfacecolor": fill, "markeredgewidth": 1.25, "markersize": size, "zorder": 3}
            xs, ys = _values(points, self.x), _values(points, self.y)
            self.ax.plot(xs, ys, linestyle="", marker=marker, label=self.label(kind), **look)

    def finish(self, negative: bool) -> Any:
        ax = self.ax
        if negative:
            ax.plot([], [], color=_COLOURS[4], linestyle="--", label=self.label("det < 0"))
        ax.set_xlabel(ax.get_xlabel() or _label(self.x))
        ax.set_ylabel(ax.get_ylabel() or _label(self.y))
        if ax.get_legend_handles_labels()[0]:
            ax.legend()
        return ax


def plot_branch(branch: Any, ax: Any, x: Any, y: Any, style: dict[str, Any] | None) -> Any:
    picture = _Picture(ax, x, y, style)
    points, pieces, events = branch.points, branch.pieces, branch.events
    departures, arrivals = branch.tangents, branch._arrivals
    looks = [(tuple(p), (s or 0) < 0) for p, s in zip(pieces, branch._segment_signs)]
    start = 0
    for i in range(1, len(looks) + 1):
        if i == len(looks) or looks[i] != looks[start]:
            part = slice(start, i + 1)
            picture.line(points[part], (departures[part], arrivals[part]), *looks[start])
            start = i
    marks = list(zip(events, points))
    picture.marks(marks + [("start", points[0])] if len(points) else marks)
    return picture.finish(any(negative for _, negative in looks))


def plot_diagram(diagram: Any, ax: Any, x: Any, y: Any, style: dict[str, Any] | None) -> Any:
    picture = _Picture(ax, x, y, style)
    dashed = False
    for edge in diagram.edges:
        # Along an edge the determinant changes its sign at smooth folds alone.
        cuts = [0, *edge.smooth_folds, len(edge.points) - 1]
        for a, b in zip(cuts, cuts[1:]):
            signs = [s for s in edge.point_det_signs[a : b + 1] if s]
            negative = bool(signs) and signs[len(signs) // 2] < 0
            dashed |= negative
            part = slice(a, b + 1)
            picture.line(edge.points[part], (edge.tangents[part], edge.tangents[part]), edge.pieces, negative)
    vertices = [(v.kind, v.x) for v in diagram.vertices]
    starts = [("start", v.x) for v in diagram.vertices if v.is_start and v.kind != "start"]
    smooth = [("smooth fold", f.x) for f in diagram.folds if f.kind == "smooth"]
    picture.marks(vertices + starts + smooth)
    return picture.finish(dashed)
