"""Charts are well-formed SVG whose lines go where the numbers say."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from hgs_core.evaluation.line_chart import Series, line_chart


def paths(svg: str) -> list[str]:
    figure = ElementTree.fromstring(svg)
    return [path.attrib["d"] for path in figure.iter("path")]


def points(path: str) -> np.ndarray:
    return np.array([[float(n) for n in pair.split()] for pair in re.findall(r"[ML]([^ML]+)", path)])


def test_a_straight_line_is_drawn_straight_from_left_to_right_and_upward() -> None:
    x = np.linspace(0.0, 10.0, 11)
    (path,) = paths(line_chart("a < b", [Series(name="a", x=x, y=3.0 * x)], x_label="x", y_label="y & z"))
    drawn = points(path)
    np.testing.assert_allclose(np.diff(drawn[:, 0]), np.diff(drawn[:, 0])[0], atol=0.11)
    np.testing.assert_allclose(np.diff(drawn[:, 1]), np.diff(drawn[:, 1])[0], atol=0.11)
    assert drawn[0, 0] < drawn[-1, 0]
    assert drawn[0, 1] > drawn[-1, 1]  # y points down in SVG


def test_what_was_not_measured_breaks_the_line() -> None:
    y = np.array([1.0, 2.0, np.nan, 2.0, 1.0])
    (path,) = paths(line_chart("t", [Series(name="a", x=np.arange(5.0), y=y)], x_label="", y_label=""))
    assert re.sub(r"[^ML]", "", path) == "MLML"


@pytest.mark.parametrize("y", [[], [np.nan, np.nan]])
def test_nothing_measured_is_said(y: list[float]) -> None:
    series = Series(name="a", x=np.arange(float(len(y))), y=np.array(y, dtype=float))
    assert "not measured" in line_chart("t", [series], x_label="", y_label="")


@pytest.mark.parametrize("value", [0.0, 5.0, -3.0, 2.4e6])
def test_a_single_or_constant_value_fits_the_axes(value: float) -> None:
    for n in (1, 4):
        series = Series(name="a", x=np.arange(float(n)), y=np.full(n, value))
        (path,) = paths(line_chart("t", [series], x_label="", y_label=""))
        drawn = points(path)
        assert np.isfinite(drawn).all()
        assert ((drawn >= 0) & (drawn <= [600, 260])).all()


def test_long_series_are_thinned_but_keep_their_ends() -> None:
    x = np.arange(100_000.0)
    svg = line_chart("t", [Series(name="a", x=x, y=x)], x_label="", y_label="")
    assert len(svg) < 20_000
    assert points(paths(svg)[0])[[0, -1], 0].tolist() == [62.0, 588.0]
