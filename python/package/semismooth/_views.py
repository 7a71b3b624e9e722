"""Tables and pictures of branches and diagrams, where pandas and matplotlib are installed. Colours and markers are those of the crate's
pictures (`Colour` and `Marker` in its module `output`)."""

import csv
import hashlib
import html
import io
import json
from collections.abc import Callable, Iterable, Sequence
from importlib import resources
from typing import Any

import numpy as np

#: Colours of combinations of pieces, in the order in which they are met.
_COLOURS = ("#0072b2", "#d55e00", "#1aa873", "#dd8fbd", "#555555")

#: The legend entry of each event.
_KINDS = {
    "pass-through": "transition",
    "fold": "fold",
    "smooth fold": "smooth fold",
    "turning point": "fold",
    "vertical segment begins": "vertical segment",
    "vertical segment ends": "vertical segment",
    "vertical segment": "vertical segment",
    "branching": "branching",
    "branch point": "branching",
    "end": "end",
    "isolated": "isolated solution",
    "Hopf point": "Hopf point",
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
    "Hopf point": ("$\\odot$", 9, "black"),
    "start": ((6, 2, 0), 9, "black"),
    "value": ("+", 8, "black"),
}

_Drawn = int | Callable[[Any], float]


class Picture(str):
    """A picture: the text of an SVG file, which notebooks show."""

    def _repr_svg_(self) -> str:
        return str(self)

    def save(self, path: Any) -> None:
        """Writes the file."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self)


def branch_table(branch: Any) -> Any:
    import pandas

    points, pieces = branch.points, branch.pieces
    names = branch.names or [f"x{i}" for i in range(points.shape[1] - 1)] + ["parameter"]
    columns = {"arclength": branch.arclength}
    columns |= {name: points[:, i] for i, name in enumerate(names)}
    columns |= {"event": branch.events}
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
    frame = pandas.DataFrame(table | {f"site{s}": columns[name] for s, name in enumerate(sites)})
    return frame.rename(columns=dict(zip([*values, "parameter"], diagram.names)))


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


def _label(what: _Drawn, names: Sequence[str]) -> str:
    if callable(what):
        return getattr(what, "__name__", "").replace("<lambda>", "")
    if names:
        return names[what]
    return "parameter" if what == -1 else f"x[{what}]"


class _Picture:
    """Axes to which curves and marks are added, with one entry of the legend for each class of lines and kind of marks."""

    def __init__(self, found: Any, ax: Any, x: _Drawn | None, y: _Drawn | None, style: dict[str, Any] | None) -> None:
        if ax is None:
            from matplotlib import pyplot

            _, ax = pyplot.subplots()
        self.ax, self.style = ax, {"linewidth": 2.0} | (style or {})
        self.x: _Drawn = -1 if x is None else x
        self.y: _Drawn = 0 if y is None else y
        self.names: list[str] = found.names
        self.words: list[dict[str, str]] = [dict(site) for site in found._legend]
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
            look["label"] = self.label(", ".join(words.get(piece, piece) for words, piece in zip(self.words, pieces)))
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

    def finish(self, dashed: bool, meaning: str = "det < 0") -> Any:
        ax = self.ax
        if dashed:
            ax.plot([], [], color=_COLOURS[4], linestyle="--", label=self.label(meaning))
        ax.set_xlabel(ax.get_xlabel() or _label(self.x, self.names))
        ax.set_ylabel(ax.get_ylabel() or _label(self.y, self.names))
        if ax.get_legend_handles_labels()[0]:
            ax.legend()
        return ax


def plot_branch(branch: Any, ax: Any, x: Any, y: Any, style: dict[str, Any] | None) -> Any:
    picture = _Picture(branch, ax, x, y, style)
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


def plot_stability(found: Any, ax: Any, x: Any, y: Any, style: dict[str, Any] | None) -> Any:
    branch = found.branch
    picture = _Picture(branch, ax, x, y, style)
    look = {"color": _COLOURS[0], "label": "_line"}
    for start, end, unstable in found.stretches:
        ends = np.array([start, end])
        lines = look | {"linestyle": "--" if unstable else "-"} | picture.style
        picture.ax.plot(_values(ends, picture.x), _values(ends, picture.y), **lines)
    marks = [*zip(branch.events, branch.points), *(("Hopf point", h.x) for h in found.hopf)]
    picture.marks([*marks, ("start", branch.points[0])])
    return picture.finish(any(unstable for *_, unstable in found.stretches), "unstable")


def plot_diagram(diagram: Any, ax: Any, x: Any, y: Any, style: dict[str, Any] | None) -> Any:
    picture = _Picture(diagram, ax, x, y, style)
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


def _number(value: float, largest: float) -> str:
    """Six digits; 0 where it is rounding beside the largest number."""
    return "0" if abs(value) <= 64 * np.finfo(float).eps * largest else f"{value:.6g}"


def _table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    def cells(entries: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(str(e))}</{tag}>" for e in entries) + "</tr>"

    body = "".join(cells(row, "td") for row in rows)
    return f"<p>{html.escape(title)}</p>" + (f"<table>{cells(head, 'th')}{body}</table>" if body else "")


#: Coordinates and rows of tables in notebooks.
_COLUMNS, _ROWS = 6, 20


def _point_rows(points: Iterable[tuple[str, Any]]) -> list[list[str]]:
    rows = []
    for kind, x in points:
        largest = float(np.max(np.abs(x), initial=0.0))
        first = x if len(x) <= _COLUMNS else [*x[: _COLUMNS - 1], x[-1]]
        rows.append([kind, *(_number(v, largest) for v in first)])
    return rows[:_ROWS]


def _point_head(m: int, names: Sequence[str], parameter: bool) -> list[str]:
    own = list(names) or [f"x[{i}]" for i in range(m - parameter)] + ["parameter"] * parameter
    return own if m <= _COLUMNS else [*own[: _COLUMNS - 1], own[-1]]


def _svg(draw: Callable[[Any], Any]) -> str:
    """A picture as text, empty where matplotlib is not installed."""
    try:
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure
    except ImportError:
        return ""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    draw(figure.add_subplot())
    text = io.StringIO()
    FigureCanvasSVG(figure).print_svg(text, metadata={"Date": None, "Creator": None})
    return "<svg" + text.getvalue().partition("<svg")[2]


#: Points that a drawing in a notebook has at most, so that saved notebooks stay small.
_DRAWN = 2000

#: The kinds under which the page knows the entries of legends.
_PAGE_KINDS = {"transition": "pass-through", "isolated solution": "isolated"}


def _thin(points: int) -> int:
    """Every how manyth point is drawn."""
    return max(1, -(-points // _DRAWN))


def _drawn_edge(points: Any, tangents: Any, signs: Sequence[int | None], label: str, folds: Sequence[int], every: int) -> dict[str, Any]:
    last = len(points) - 1
    kept = sorted({*range(0, last, every), *folds, last})
    columns = _columns(points.shape[1])
    return {
        "points": _digits(points[kept][:, columns]),
        "tangents": _digits(tangents[kept][:, columns]),
        "det": [signs[k] for k in kept],
        "folds": [kept.index(k) for k in folds],
        "label": label,
    }


def _digits(rows: Any) -> list[list[float]]:
    """With the digits that pictures and what is read off them have."""
    return [[float(f"{v:.9g}") for v in row] for row in rows]


def _columns(m: int) -> list[int]:
    return list(range(m)) if m <= _COLUMNS else [*range(_COLUMNS - 1), m - 1]


def _drawn_vertices(marks: Iterable[tuple[str, Any]]) -> list[dict[str, Any]]:
    vertices: list[dict[str, Any]] = []
    for event, x in marks:
        kind = _KINDS.get(event)
        if kind is not None and kind not in ("smooth fold", "start", "Hopf point"):
            vertices.append({"kind": _PAGE_KINDS.get(kind, kind), "x": _digits([x[_columns(len(x))]])[0], "number": len(vertices) + 1})
    return vertices


def _interactive(static: str, found: Any, m: int, drawing: dict[str, Any]) -> str:
    """The picture drawn by the page's own functions once the notebook runs them, the static one until then and elsewhere."""
    names = _point_head(m, found.names, True)
    data = json.dumps({"names": names, "drawing": drawing}, allow_nan=False)
    # Two outputs of one notebook may show the same curve: then one of them is drawn over by the same picture.
    own = f"semismooth-{hashlib.sha256(data.encode()).hexdigest()[:12]}"
    folder = resources.files("semismooth")
    scripts = [(folder / name).read_text(encoding="utf-8") for name in ("_drawing.js", "_notebook.js")]
    # In a string of a script the browser looks for its end all the same.
    data = data.replace("<", "\\u003c").replace("{", f'{{"id": "{own}", ', 1)
    body = "\n".join([f"const own = {data};", *scripts])
    return f'<div id="{own}">{static}</div><script>(() => {{\n{body}\n}})();</script>'


def _curve_drawing(branch: Any) -> dict[str, Any]:
    points, tangents, events = branch.points, branch.tangents, branch.events
    words = [dict(site) for site in branch._legend]
    looks = [(tuple(p), (s or 0) < 0) for p, s in zip(branch.pieces, branch._segment_signs)]
    edges: list[dict[str, Any]] = []
    every, start = _thin(len(points)), 0
    for i in range(1, len(looks) + 1):
        # Corners are not rounded: edges end at them.
        if i == len(looks) or looks[i] != looks[start] or events[i] not in ("point", "smooth fold"):
            pieces, negative = looks[start]
            few = 0 < len(pieces) <= 2
            label = ", ".join(site.get(piece, piece) for site, piece in zip(words, pieces)) if few else ""
            part = slice(start, i + 1)
            folds = [k - start for k in range(start + 1, i) if events[k] == "smooth fold"]
            signs = [-1 if negative else 1] * (i + 1 - start)
            departures = np.vstack([tangents[start:i], branch._arrivals[i : i + 1]])
            edges.append(_drawn_edge(points[part], departures, signs, label, folds, every))
            start = i
    return {"vertices": _drawn_vertices(zip(events, points)), "edges": edges}


def _diagram_drawing(diagram: Any) -> dict[str, Any]:
    words = [dict(site) for site in diagram._legend]
    edges: list[dict[str, Any]] = []
    every = _thin(sum(len(edge.points) for edge in diagram.edges))
    for edge in diagram.edges:
        few = 0 < len(edge.pieces) <= 2
        label = ", ".join(site.get(piece, piece) for site, piece in zip(words, edge.pieces)) if few else ""
        edges.append(_drawn_edge(edge.points, edge.tangents, edge.point_det_signs, label, edge.smooth_folds, every))
    return {"vertices": _drawn_vertices((v.kind, v.x) for v in diagram.vertices), "edges": edges}


def branch_html(branch: Any) -> str:
    events = [(e, x) for e, x in zip(branch.events, branch.points) if e != "point"]
    head = ["event", *_point_head(branch.points.shape[1], branch.names, True)]
    picture = _interactive(_svg(lambda ax: branch.plot(ax=ax)), branch, branch.points.shape[1], _curve_drawing(branch))
    return picture + _table(repr(branch)[1:-1], head, _point_rows(events))


def diagram_html(diagram: Any) -> str:
    vertices = [(v.kind, v.x) for v in diagram.vertices]
    m = len(vertices[0][1]) if vertices else 1
    head = ["kind", *_point_head(m, diagram.names, True)]
    picture = _interactive(_svg(lambda ax: diagram.plot(ax=ax)), diagram, m, _diagram_drawing(diagram))
    return picture + _table(repr(diagram)[1:-1], head, _point_rows(vertices))


def list_html(found: Any) -> str:
    rows = _point_rows([("" if s.index is None else str(s.index), s.x) for s in found.solutions])
    return _table(repr(found)[1:-1], ["index", *_point_head(found.points.shape[1], [], False)], rows)
