"""Reports: pages that state what the solvers return."""

import html
import re

import numpy as np
import pytest

import semismooth as ss


def beam(x):
    y, load = x
    return [y - 1.25 * ss.maximum(y - 1, 0) + 10 * ss.maximum(y - 3, 0) - load]


def block(form="condensed"):
    body = ss.Body(ss.Mesh.rectangle([0, 0], [2, 1], [8, 4]), ss.Material(1.0, 0.3), supports={"top": [0.0, -0.02]})
    ground = ss.Foundation.plane([0, 0], [0, 1])
    return ss.ContactProblem(body, "bottom", ground, 0.4, rate=body.motion("top", [0.05, None]), form=form)


def tables(path):
    """The tables to copy, as lists of rows."""
    page = path.read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org/2000/svg", "") and "https://" not in page
    found = re.findall(r"<textarea[^>]*>\n(.*?)</textarea>", page, re.DOTALL)
    return page, [[row.split("\t") for row in html.unescape(t).strip("\n").split("\n")] for t in found]


def test_the_table_is_the_curve(tmp_path):
    path = tmp_path / "beam.html"
    ss.report(beam, path, (0.0, 2.0), [0.0], names=["y", "load"], title="A <beam> & a stop")
    branch = ss.follow(beam, [0.0, 0.0], (0.0, 2.0), max_time=20.0)
    page, [curve] = tables(path)
    assert curve[0] == ["arclength", "load", "event", "y"]
    numbers = np.array([[float(row[3]), float(row[1])] for row in curve[1:]])
    assert np.array_equal(numbers, branch.points)
    assert [row[2] for row in curve[1:]] == branch.events
    assert "<h1>A &lt;beam&gt; &amp; a stop</h1>" in page and "<beam>" not in page
    # Three solutions between the folds at 1/2 and 1, proven, and names of pieces as the formulas have them.
    assert re.search(r'<td class="n">0.75</td><td class="n">3</td><td>proven: there are no others</td>', page)
    assert "0 → y − 1" in page or "y − 1" in page


def test_a_contact_problem_has_its_nodes_and_pictures(tmp_path):
    path = tmp_path / "block.html"
    problem = block()
    ss.report(problem, path, (0.0, 1.0), loads=[1.0])
    branch = ss.follow(problem, problem.solve(0.0), (0.0, 1.0), max_time=20.0)
    page, [nodes, curve] = tables(path)
    assert [row[1] for row in curve[1:]] == [repr(float(a)) for a in branch.parameter]
    normal = curve[0].index("sum of normal forces")
    sums = [float(row[normal]) for row in curve[1:]]
    assert np.allclose(sums, branch.points[:, :9].sum(axis=1), rtol=1e-12)
    assert len(nodes) == 1 + 9 and page.count("<svg") > 2
    slips = sorted(float(row[nodes[0].index("first slip")]) for row in nodes[1:] if row[3][0].isdigit())
    assert set(slips) <= set(branch.parameter)


def test_a_history_has_its_energies(tmp_path):
    path = tmp_path / "history.html"
    problem, levels = block(), [0.0, 0.5, 1.0, 0.0]
    ss.report(problem, path, levels=levels)
    steps = ss.evolve(problem, problem.solve(0.0), levels[1:])
    _, [_, rows] = tables(path)
    column = rows[0].index("dissipated")
    assert [float(row[column]) for row in rows[1:]] == [s.dissipated for s in steps]


def test_what_is_wrong_is_said(tmp_path):
    path = tmp_path / "none.html"
    for arguments, options, message in [
        ((beam, path, (0.0, 2.0)), {}, "x0 is wanted"),
        ((beam, path), {"x0": [0.0]}, "parameter_range is wanted"),
        ((beam, path, (1.0, 1.0), [0.0]), {}, "two different finite values"),
        ((beam, path, (0.0, 1.0), [0.0]), {"drawn": [7]}, "variable 7 is to be drawn"),
        ((beam, path, (0.0, 1.0), [0.0]), {"max_time": -1.0}, "max_time = -1"),
        ((block(), path), {}, "one of parameter_range and levels"),
        ((block("full"), path, (0.0, 1.0)), {}, "condensed"),
        ((block(), path, (0.0, 1.0), [0.0]), {}, "leave out x0"),
    ]:
        with pytest.raises(ValueError, match=message):
            ss.report(*arguments, **options)
    assert not path.exists()
