"""Curves and diagrams in notebooks: a picture that the page's own functions draw, without a network, and a static one where no script runs."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
import semismooth as ss


def beam(x):
    return [x[0] - 1.25 * ss.maximum(x[0] - 1, 0) + 10 * ss.maximum(x[0] - 3, 0) - x[1]]


def curve(**more):
    return ss.follow(beam, [0.0, 0.0], parameter_range=(0.0, 2.0), **more)


def diagram():
    return ss.diagram(lambda x: [x[0] ** 3 - x[1] * x[0]], [[0.0, -0.5]], parameter_range=(-1.0, 1.0))


def data(text):
    found = re.search(r"const own = (\{.*\});\n", text)
    return json.loads(found[1])


def test_edges_end_where_pieces_change():
    branch = curve(names=["y", "load"])
    own = data(branch._repr_html_())
    assert own["names"] == ["y", "load"]
    edges = own["drawing"]["edges"]
    ends = [(e["points"][0], e["points"][-1]) for e in edges]
    np.testing.assert_allclose(ends, [([0, 0], [1, 1]), ([1, 1], [3, 0.5]), ([3, 0.5], [30.75 / 9.75, 2])], atol=1e-8)
    assert [e["det"][0] for e in edges] == [1, -1, 1]
    assert [(v["kind"], v["number"]) for v in own["drawing"]["vertices"]] == [("fold", 1), ("fold", 2)]
    # Tangents are those of the edge at both of its ends.
    for edge in edges:
        chord = np.subtract(edge["points"][-1], edge["points"][0])
        for tangent in edge["tangents"]:
            assert np.dot(tangent, chord) == pytest.approx(np.linalg.norm(chord))


def test_diagrams_have_their_edges_and_vertices():
    found = diagram()
    own = data(found._repr_html_())
    assert len(own["drawing"]["edges"]) == len(found.edges)
    assert [v["kind"] for v in own["drawing"]["vertices"]] == ["branching"]


def test_nothing_comes_from_elsewhere():
    for found in (curve(), diagram()):
        text = found._repr_html_()
        addresses = set(re.findall(r"""(?:src|href|url|import|fetch)\W{1,3}(https?://[^"')\s]+)""", text))
        assert not addresses
        assert text.count("<script>") == text.count("</script>") == 1


def test_names_cannot_end_the_script():
    name = "</script><script>alert(1)</script>"
    text = curve(names=[name, "load"])._repr_html_()
    assert text.count("</script>") == 1 and text.count("<script>") == 1
    assert data(text)["names"][0] == name


def test_long_curves_are_thinned_but_keep_their_ends():
    branch = ss.follow(lambda x: [x[0] - np.sin(x[1])], [0.0, 0.0], (0.0, 30.0), step=5e-3, max_step=5e-3)
    assert len(branch) > 4000
    text = branch._repr_html_()
    (edge,) = data(text)["drawing"]["edges"]
    assert len(edge["points"]) < 2200
    np.testing.assert_allclose(edge["points"][0], branch.points[0], atol=1e-8)
    np.testing.assert_allclose(edge["points"][-1], branch.points[-1], atol=1e-7)
    assert len(text.split("<script>")[1]) < 300_000


@pytest.mark.skipif(shutil.which("node") is None, reason="no Node")
def test_the_script_draws_in_a_document():
    # The few parts of a document that it uses; how it looks is for eyes.
    document = """
    const element = () => ({ children: [], dataset: {}, style: {}, listeners: {}, hidden: false, value: '0', innerHTML: '', textContent: '',
      append(...more) { this.children.push(...more); }, add() {}, setAttribute() {}, replaceChildren(...more) { this.children = more; },
      addEventListener(name, f) { this.listeners[name] = f; }, querySelector() { return this.cursor ??= element(); },
      get firstChild() { return this.child ??= element(); }, getContext: () => ({ measureText: (t) => ({ width: 7 * t.length }) }) });
    const room = element();
    globalThis.document = { createElement: element, getElementById: () => room, body: element() };
    globalThis.matchMedia = () => ({ matches: false });
    globalThis.Option = function Option() {};
    """
    look = """
    const [label, place, told] = room.children;
    place.listeners.keydown({ key: 'ArrowRight', preventDefault() {} });
    console.log(JSON.stringify({ svg: place.innerHTML, told: told.textContent }));
    """
    script = re.search(r"<script>(.*)</script>", curve(names=["y", "load"])._repr_html_(), re.S)[1]
    done = subprocess.run(["node", "-e", document + script + look], capture_output=True, text=True, check=True)
    seen = json.loads(done.stdout)
    assert seen["svg"].startswith("<svg") and not re.search("NaN|Infinity|undefined", seen["svg"])
    # Three arms, the dashed one with a negative determinant.
    assert len(re.findall(r'<path d="M[0-9.,]+L[^"]*" stroke="#[0-9a-f]{6}"', seen["svg"])) == 3
    assert "det &lt; 0" in seen["svg"] and "load" in seen["svg"]
    assert seen["told"] == "y = 1.000000, load = 1.000000"
