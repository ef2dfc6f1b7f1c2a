"""Parts of the page's JavaScript that only compute, asked in the browser that they are written for."""

import numpy as np
import pytest

from app.settings import Settings
from tests.app.fake_mission import runner
from tests.app.live_service import serving
from tests.browser.conftest import new_page

pytestmark = pytest.mark.timeout(420)


@pytest.fixture(scope="module")
def scripts(tmp_path_factory, chromium):
    """Ask a module: `scripts("estimate", "timeLeft", arguments)`; the service has no missions."""
    settings = Settings(data_dir=tmp_path_factory.mktemp("modules"), viewer=False, mission_threads=1)
    with (
        serving(settings, runner=runner("run_short")) as service,
        new_page(chromium, service.url) as page,
    ):
        yield lambda module, name, *arguments: page.evaluate(
            f"(args) => import('/js/{module}.js').then((found) => found.{name}(...args))", list(arguments)
        )


def test_the_estimate_is_exact_where_what_is_missing_falls_evenly(scripts):
    """From 20 m³ down by 0.1 m³ a second: after 100 s there are 10 m³, and 90 s more to a twentieth of 20."""
    times = np.arange(0, 101, 2.0)
    least, most = scripts("estimate", "timeLeft", times.tolist(), (20 - 0.1 * times).tolist())
    assert least == pytest.approx(90, rel=0.01)
    assert most > least


def test_the_estimate_is_a_range_where_the_fall_slows_down(scripts):
    """Halved every 40 s, what is missing has fallen to a twentieth after 173 s: 93 s from now."""
    times = np.arange(0, 81, 2.0)
    least, most = scripts("estimate", "timeLeft", times.tolist(), (20 * 0.5 ** (times / 40)).tolist())
    assert least < 93
    assert most == pytest.approx(40 * np.log2(20) - 80, rel=0.02)


@pytest.mark.parametrize("missing", [[5.0] * 50, list(range(50)), [20.0] * 45 + [19.9] * 5], ids=str)
def test_there_is_no_estimate_where_there_is_no_trend(scripts, missing):
    assert scripts("estimate", "timeLeft", list(range(50)), missing) is None


def test_nothing_is_left_where_nothing_is_missing(scripts):
    assert scripts("estimate", "timeLeft", list(range(50)), [20.0] + [0.5] * 49) == [0, 0]
    assert scripts("estimate", "timeLeft", [], []) is None


def test_a_schema_becomes_fields_with_unit_and_range(scripts):
    schema = {
        "$defs": {
            "Limits": {
                "description": "When it ends.",
                "properties": {
                    "max_time_s": {
                        "type": "number",
                        "exclusiveMinimum": 0,
                        "description": "Mission\ntime [s].",
                    },
                    "scale": {"anyOf": [{"type": "number"}, {"type": "null"}], "description": "Factor."},
                },
            },
            "Clock": {"enum": ["lockstep", "real"], "type": "string"},
        },
        "properties": {"limits": {"$ref": "#/$defs/Limits"}, "clock": {"$ref": "#/$defs/Clock"}},
    }
    values = {"limits": {"max_time_s": 60, "scale": None}, "clock": "real"}
    sections = {
        section["name"]: section for section in scripts("settings-form", "sectionsOf", schema, values)
    }
    assert sections["limits"]["description"] == "When it ends."
    limit, scale = sections["limits"]["fields"]
    assert (limit["path"], limit["title"], limit["unit"]) == ("limits.max_time_s", "max time", "s")
    assert (limit["minimum"], limit["exclusive"], limit["value"]) == (0, True, 60)
    assert limit["description"] == "Mission time [s]."
    assert (scale["kind"], scale["nullable"]) == ("number", True)
    assert sections[""]["fields"][0]["choices"] == ["lockstep", "real"]


@pytest.mark.parametrize(
    ("pair", "better", "text", "verdict"),
    [
        ([30.0, 31.5], 1, "▲ +1.5", "better"),
        ([30.0, 31.5], -1, "▼ +1.5", "worse"),
        ([30.0, 28.0], 0, "−2", ""),
        ([30.0, 30.01], 1, "=", ""),
        ([30.0, None], 1, "–", ""),
    ],
)
def test_differences_say_which_is_better(scripts, pair, better, text, verdict):
    """More is better (1), less is (-1), or neither (0); what rounds to nothing is no difference."""
    title = {1: "PSNR", -1: "Path", 0: "Gaussians"}[better]
    told = scripts("comparison-figures", "compared", title, pair)
    assert told == {"text": text, "verdict": verdict}


@pytest.mark.parametrize(
    ("point", "inside"), [([1, 1], True), ([3, 3], False), ([3, 1], True), ([5, 1], False)]
)
def test_a_point_lies_in_a_polygon_or_not(scripts, point, inside):
    """An L: the square from 0 to 4 without its upper right quarter."""
    corners = [[0, 0], [4, 0], [4, 2], [2, 2], [2, 4], [0, 4]]
    assert scripts("top-view/editor", "contains", corners, point) is inside
