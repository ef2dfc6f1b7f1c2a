"""Areas and means of completion curves, against numbers worked out by hand."""

from xml.etree import ElementTree

import numpy as np
import pytest

from hgs_core.benchmark.planners.curve import CompletionCurve, area_under, held, longest_m
from hgs_core.errors import ConfigError
from hgs_core.evaluation.band_chart import Band, band_chart


def curve(*samples: tuple[float, float, float]) -> CompletionCurve:
    columns = np.array(samples).T
    return CompletionCurve(path_m=columns[0], time_s=columns[1], ratio=columns[2])


TURN_AND_DRIVE = curve((0, 0, 0.1), (0, 2, 0.3), (4, 6, 0.7), (8, 10, 0.9))
"""Turns on the spot, then drives 8 m."""


def test_area_by_hand() -> None:
    # (0.3 + 0.7) / 2 * 4 + (0.7 + 0.9) / 2 * 4 = 2 + 3.2 over the mission's 8 m; then 0.9 for 2 m more.
    assert area_under(TURN_AND_DRIVE, 8.0) == pytest.approx(5.2 / 8)
    assert area_under(TURN_AND_DRIVE, 10.0) == pytest.approx(7.0 / 10)
    assert longest_m([TURN_AND_DRIVE, curve((0, 0, 0.1), (10, 9, 0.5))]) == 10.0
    with pytest.raises(ValueError, match="longer than 7"):
        area_under(TURN_AND_DRIVE, 7.0)


def test_a_curve_that_begins_on_the_way_rises_from_nothing() -> None:
    late = curve((2, 1, 0.4), (4, 2, 0.4))
    assert area_under(late, 4.0) == pytest.approx((0.4 + 0.8) / 4)
    np.testing.assert_allclose(held(late.path_m, late.ratio, np.array([0.0, 1.0, 3.0])), [0.0, 0.2, 0.4])


def test_held_values_are_the_last_of_a_place_and_the_final_one_behind_the_end() -> None:
    at = np.array([0.0, 2.0, 8.0, 20.0])
    np.testing.assert_allclose(held(TURN_AND_DRIVE.path_m, TURN_AND_DRIVE.ratio, at), [0.3, 0.5, 0.9, 0.9])


def test_a_report_without_a_curve_has_none_and_a_wrong_one_is_refused() -> None:
    assert CompletionCurve.of({}) is None
    assert CompletionCurve.of({"completion_curve": []}) is None
    wrong = {"completion_curve": [{"path_m": p, "time_s": 0.0, "ratio": 0.1} for p in (0.0, 2.0, 1.0)]}
    with pytest.raises(ConfigError, match="path_m must never fall"):
        CompletionCurve.of(wrong)


def bands(n: int) -> list[Band]:
    x = np.linspace(0.0, 10.0, 11)
    return [
        Band(
            name=f"a < {style}",
            style=style,
            x=x,
            mean=x / 10,
            lower=x / 20,
            upper=x / 10,
            ends=np.array([[10.0, 1.0]]),
        )
        for style in range(n)
    ]


def chart(n: int) -> ElementTree.Element:
    text = band_chart(
        "t & u", bands(n), subtitle="s", x_label="x", y_label="y", upper_part=(0.8, 1.0), marks=(0.9,)
    )
    return ElementTree.fromstring(text)


SVG = "{http://www.w3.org/2000/svg}"


def test_no_two_planners_look_the_same() -> None:
    curves = [path for path in chart(30).iter(f"{SVG}path") if path.attrib["class"] == "curve"]
    looks = {(path.attrib["stroke"], path.attrib.get("stroke-dasharray")) for path in curves}
    assert len(curves) == 3 * 30  # in both panels and in the key
    assert len(looks) == 30


def test_the_curve_goes_from_corner_to_corner_of_the_whole_view() -> None:
    whole = next(path for path in chart(1).iter(f"{SVG}path") if path.attrib["class"] == "curve")
    frame = next(rect for rect in chart(1).iter(f"{SVG}rect") if rect.attrib.get("class") == "frame")
    left, top, width, height = (float(frame.attrib[name]) for name in ("x", "y", "width", "height"))
    points = [[float(n) for n in pair.split()] for pair in whole.attrib["d"][1:].split("L")]
    assert points[0] == pytest.approx([left, top + height], abs=0.1)
    assert points[-1] == pytest.approx([left + width, top], abs=0.1)
