"""Stability of equilibria: normal forms with eigenvalues in closed form."""

import numpy as np
import pytest
import semismooth as ss


def brusselator(x, a=1.3):
    u, v, b = x
    return [a + u**2 * v - (b + 1) * u, b * u - u**2 * v]


def test_hopf_point_of_the_brusselator():
    # λ² − (b − 1 − a²) λ + a² = 0.
    told = []
    found = ss.follow_equilibria(
        brusselator,
        [1.3, 0.5 / 1.3, 0.5],
        (0.5, 4.0),
        callback=lambda line: told.append(line["event"]),
        names=["u", "v", "b"],
    )
    (hopf,) = found.hopf
    assert hopf.parameter == pytest.approx(1 + 1.3**2, abs=1e-11) and hopf.frequency == pytest.approx(1.3, abs=1e-10)
    np.testing.assert_allclose(hopf.x, [1.3, hopf.parameter / 1.3, hopf.parameter], atol=1e-10)
    np.testing.assert_allclose(hopf.spectrum.eigenvalues, [1.3j, -1.3j], atol=1e-10)
    assert found.unexplained == [] and found.kinks == [] and found.branch.names == ["u", "v", "b"] and "Hopf" in told
    assert repr(found).startswith("<StabilityBranch: 1 Hopf point, 0 kinks; ")
    for start, end, unstable in found.stretches:
        assert unstable == (2 if start[2] + end[2] > 2 * hopf.parameter else 0)
    before, after = (ss.spectrum(brusselator, [1.3, b / 1.3, b]) for b in (1.0, 3.0))
    assert (before.stable, before.unstable, after.stable, after.unstable) == (True, 0, False, 2)
    assert repr(after) == "<Spectrum: 2 eigenvalues with positive real parts>"
    np.testing.assert_allclose(after.eigenvalues.sum(), 3.0 - 1 - 1.3**2, atol=1e-12)


def test_algebraic_equations():
    def with_rate(x):
        u, v, rate, b = x
        return [1.3 + rate - (b + 1) * u, 3 * (b * u - rate), u**2 * v - rate]

    found = ss.follow_equilibria(with_rate, [1.3, 0.5 / 1.3, 0.65, 0.5], (0.5, 4.0), mass=[1.0, 3.0, 0.0])
    assert [h.parameter for h in found.hopf] == pytest.approx([1 + 1.3**2], abs=1e-11)
    with pytest.raises(ss.SemismoothError, match="index 1"):
        ss.spectrum(lambda x: [x[1] - x[2] - x[0], x[0]], np.zeros(3), mass=[1.0, 0.0])
    # A multiple eigenvalue 0 has no sign.
    assert ss.spectrum(lambda x: [x[1], 0 * x[0]], np.zeros(3)).stable is None


def test_equilibria_at_kinks():
    fold = ss.follow_equilibria(lambda x: [x[2] - abs(x[0]), -x[1]], [1.0, 0.0, 1.0], (-1.0, 1.0), "decreasing")
    (kink,) = fold.kinks
    assert (kink.kind, kink.before.unstable, kink.after.unstable) == ("non-smooth fold", 0, 1)
    assert kink.transition.parameter == pytest.approx(0.0, abs=1e-14) and kink.transition.kind == "fold"
    passed = ss.follow_equilibria(lambda x: [x[1] - 2 * x[0] - ss.maximum(x[0], 0)], [-0.5, -1.0], (-1.0, 1.0))
    assert [k.kind for k in passed.kinks] == ["persistence"]


def test_pictures_say_unstable():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    found = ss.follow_equilibria(brusselator, [1.3, 0.5 / 1.3, 0.5], (0.5, 4.0))
    ax = found.plot(y=1)
    labels = ax.get_legend_handles_labels()[1]
    assert {"unstable", "Hopf point", "start"} <= set(labels) and "det < 0" not in labels
    styles = {line.get_linestyle() for line in ax.get_lines()}
    assert {"-", "--"} <= styles
    pyplot.close("all")


@pytest.mark.parametrize(
    ("arguments", "options", "match"),
    [
        ((brusselator, [1.0, 1.0]), {}, "unpack|length 2"),
        ((lambda x: [x[0]], [0.0, 0.0, 0.0]), {}, "length 3 H must give 2 values; it gives 1"),
        ((brusselator, [1.0, 1.0, 1.0]), {"mass": [1.0]}, "diagonal of M"),
        ((brusselator, [1.0, 1.0, 1.0]), {"mass": [0.0, 0.0]}, "different from 0"),
        ((brusselator, [1.0, np.nan, 1.0]), {}, "NaN|nan|finite"),
    ],
)
def test_bad_input(arguments, options, match):
    for function in (ss.spectrum, ss.follow_equilibria):
        with pytest.raises((ValueError, TypeError), match=match):
            function(*arguments, **options)
