"""The timeline: moments on disk, and how a page gets them."""

import errno
import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from app.missions.display import IMAGE_KINDS
from app.missions.display_builder import display_view
from app.missions.moment_recorder import MomentRecorder
from app.missions.moments import MomentArchive, MomentSettings
from app.missions.top_view import MAX_PX, PIXEL_M, top_view, top_view_facts
from tests.app.conftest import begin, create, wait_for, wait_until
from tests.app.fake_world import FURNITURE, ROOM_M, furnished_room, robot_at

BELOW_M = 2.2


@pytest.fixture(scope="module")
def view():
    """What a viewer is shown of the furnished fake room, all of it seen."""
    seen = furnished_room()
    return display_view(seen, max_splats=100_000, max_image_width=640)


@pytest.fixture
def archive(tmp_path):
    return MomentArchive(tmp_path, MomentSettings(most=8, interval_s=2.0), below_m=BELOW_M)


def keep(archive, view, times_s):
    """Offer views of these mission times, as the mission does; path grows by a metre a second."""
    for time_s in times_s:
        if archive.is_due(time_s):
            archive.record(replace(view, time_s=float(time_s)), sequence=time_s, path_length_m=float(time_s))


def pixel_at(drawn, x_m: float, y_m: float) -> list[int]:
    column = int((x_m - drawn.lower_m[0]) / drawn.pixel_m)
    row = drawn.image.shape[0] - 1 - int((y_m - drawn.lower_m[1]) / drawn.pixel_m)
    return [int(value) for value in drawn.image[row, column]]


def test_the_map_from_above_shows_furniture_and_floor_where_they_stand(view):
    """Three boxes stand at known corners of a known floor, below a ceiling that is left out."""
    drawn = top_view(view, below_m=BELOW_M)
    for x, y, colour in FURNITURE:
        found = pixel_at(drawn, x + 0.6, y + 0.4)
        assert found[3] == 255
        # Tints vary by a chequer of 0.12 and some noise.
        np.testing.assert_allclose(np.array(found[:3]) / 255, colour, atol=0.25)
    floor = pixel_at(drawn, 3.0, 4.4)
    np.testing.assert_allclose(np.array(floor[:3]) / 255, (0.55, 0.42, 0.3), atol=0.25)
    width, depth, _ = ROOM_M
    assert drawn.pixel_m == PIXEL_M
    assert -0.6 < drawn.lower_m[0] < 0.0
    assert width < drawn.upper_m[0] < width + 0.6
    assert depth < drawn.upper_m[1] < depth + 0.6
    assert drawn.image[0, 0, 3] == 0  # outside nothing is known


def test_with_the_ceiling_the_ceiling_is_all_there_is(view):
    drawn = top_view(view, below_m=3.0)
    np.testing.assert_allclose(np.array(pixel_at(drawn, 1.6, 1.4)[:3]) / 255, (0.85,) * 3, atol=0.25)


def test_a_large_map_makes_no_larger_picture(view):
    far = replace(view, splat_centres_m=view.splat_centres_m * np.array([20, 20, 1], np.float32))
    drawn = top_view(far, below_m=BELOW_M)
    assert max(drawn.image.shape) <= MAX_PX + 1
    assert drawn.upper_m[0] - drawn.lower_m[0] == pytest.approx(160, rel=0.02)


def test_a_map_of_nothing_is_one_clear_pixel(view):
    empty = {name: getattr(view, name)[:0] for name in view.arrays() if name.startswith("splat_")}
    drawn = top_view(replace(view, **empty), below_m=BELOW_M)
    assert drawn.image.shape == (1, 1, 4)
    assert not drawn.image.any()


def test_what_belongs_over_the_map_is_told_in_metres_and_degrees(view):
    facts = top_view_facts(view, top_view(view, below_m=BELOW_M))
    robot = robot_at(0.3, 7)
    assert facts["robot"]["x_m"] == pytest.approx(robot.x_m, abs=1e-3)
    turn = facts["robot"]["yaw_deg"] - np.degrees(robot.yaw_rad)
    assert (turn + 180) % 360 - 180 == pytest.approx(0, abs=0.1)
    assert facts["field_of_view_deg"] == pytest.approx(90)  # 320 px wide, focal length 160 px
    assert facts["trajectory"][3] == [0.3, 0.0]
    assert len(facts["subspaces"]) == 8
    assert facts["local_path"]
    assert facts["global_tour"]


def test_moments_come_as_often_as_stated_and_keep_what_was_seen(archive, view):
    keep(archive, view, range(7))
    kept = archive.all()
    assert [moment.time_s for moment in kept] == [0, 2, 4, 6]
    assert [moment.number for moment in kept] == [1, 2, 3, 4]
    assert archive.find(3) == kept[2]
    for kind in IMAGE_KINDS:
        assert Image.open(io.BytesIO(archive.image(2, kind))).format == "JPEG"
    above = Image.open(io.BytesIO(archive.top_view(2))).convert("RGBA")
    facts = archive.facts(2)
    assert above.width == pytest.approx((facts["upper_m"][0] - facts["lower_m"][0]) / PIXEL_M, abs=1)
    assert archive.find(9) is None
    assert archive.image(9, "depth") is None


def test_there_are_never_more_than_stated_and_they_stay_evenly_spread(archive, view, tmp_path):
    """Eight times as long as eight moments of 2 s last: in the end one every 16 s or more."""
    keep(archive, view, range(128))
    kept = archive.all()
    assert len(kept) <= 8
    assert len(list(tmp_path.iterdir())) == len(kept)
    assert kept[0].time_s == 0
    gaps = np.diff([moment.time_s for moment in kept])
    assert gaps.max() <= 2 * kept[-1].interval_s
    assert kept[-1].time_s + kept[-1].interval_s >= 127


def test_moments_outlive_the_service_and_go_on(archive, view, tmp_path):
    keep(archive, view, range(40))
    again = MomentArchive(tmp_path, MomentSettings(most=8, interval_s=2.0), below_m=BELOW_M)
    assert again.all() == archive.all()
    keep(again, view, range(40, 60))
    assert again.all()[-1].number > archive.all()[-1].number
    assert again.all()[-1].interval_s >= archive.all()[-1].interval_s
    assert len(again.all()) <= 8


def test_a_mission_that_was_set_back_is_recorded_from_there(archive, view):
    keep(archive, view, [0, 2, 4])
    assert archive.is_due(1.0)
    keep(archive, view, [1, 2, 3])
    assert [moment.time_s for moment in archive.all()] == [0, 2, 4, 1, 3]


def test_a_file_that_is_no_moment_is_passed_over(archive, view, tmp_path):
    keep(archive, view, [0, 2])
    (tmp_path / "000002.zip").write_bytes(b"half a zip")
    fresh = MomentArchive(tmp_path, MomentSettings(), below_m=BELOW_M)
    assert [moment.number for moment in fresh.all()] == [1]
    assert fresh.top_view(2) is None


def test_the_past_of_a_mission_can_be_looked_at_while_it_runs_and_after(service):
    client = service("run_long", display={"interval_s": 0.05}, moments={"interval_s": 0.4, "most": 30})
    mission = begin(client)
    path = f"/api/v1/missions/{mission}"
    wait_until(lambda: len(client.get(f"{path}/moments").json()["moments"]) >= 4)
    live = client.get(f"{path}/top-view").json()
    assert live["view_sequence"] > 0
    drawn = client.get(f"{path}/top-view.png")
    assert Image.open(io.BytesIO(drawn.content)).format == "PNG"
    client.post(f"{path}/stop")
    wait_for(client, mission, "aborted")

    client = service("run_long")  # another service on the same data
    moments = client.get(f"{path}/moments").json()["moments"]
    assert [moment["number"] for moment in moments] == sorted(moment["number"] for moment in moments)
    for moment in (moments[1], moments[-1]):
        there = f"{path}/moments/{moment['number']}"
        told = client.get(there).json()
        assert {key: told[key] for key in moment} == moment
        assert told["figures"]["sequence"] == moment["sequence"]
        assert told["plan"]["sequence"] <= moment["sequence"]
        assert told["figures"]["path_length_m"] == moment["path_length_m"]
        assert len(told["top_view"]["trajectory"]) >= 1
        for kind in IMAGE_KINDS:
            assert client.get(f"{there}/images/{kind}").headers["content-type"] == "image/jpeg"
        assert client.get(f"{there}/top-view.png").headers["content-type"] == "image/png"
    last = client.get(f"{path}/moments/{moments[-1]['number']}").json()
    first = client.get(f"{path}/moments/{moments[0]['number']}").json()
    assert len(last["top_view"]["trajectory"]) > len(first["top_view"]["trajectory"])
    rest = client.get(f"{path}/moments", params={"after": moments[1]["number"], "limit": 1}).json()["moments"]
    assert rest == [moments[2]]
    tag = client.get(f"{path}/top-view.png").headers["etag"]
    assert client.get(f"{path}/top-view.png", headers={"If-None-Match": tag}).status_code == 304
    for wrong, status in (("999999", 404), ("0", 422), ("first", 422)):
        assert client.get(f"{path}/moments/{wrong}").status_code == status


def test_a_mission_that_never_ran_has_no_past(service):
    client = service()
    path = f"/api/v1/missions/{create(client)}"
    assert client.get(f"{path}/moments").json() == {"moments": []}
    assert client.get(f"{path}/top-view").status_code == 404
    assert client.get(f"{path}/top-view.png").status_code == 404


def test_a_full_disk_costs_the_timeline_and_not_the_mission(service, monkeypatch):
    def full(*_args):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("app.missions.moments.write_whole", full)
    client = service("run_short", display={"interval_s": 0.05}, moments={"interval_s": 0.4})
    mission = begin(client)
    wait_for(client, mission, "completed")
    notices = client.get(f"/api/v1/missions/{mission}/events", params={"kind": "notice"}).json()["events"]
    told = [notice for notice in notices if "timeline" in notice["message"]]
    assert len(told) == 1
    assert "No space left" in told[0]["message"]


def test_a_view_waits_for_the_figures_of_its_frame(archive, view):
    """Views come before the figures of their frame; a moment never has those of the frame before."""
    recorder = MomentRecorder(archive, failed=lambda *_: pytest.fail("nothing failed"))
    for frame in range(3):
        time_s = 2.0 * frame
        recorder.take_view(replace(view, time_s=time_s))
        assert len(archive.all()) == frame
        recorder.take_figures({"sequence": 10 + frame, "time_s": time_s, "path_length_m": 0.5 * frame})
    kept = archive.all()
    assert [moment.sequence for moment in kept] == [10, 11, 12]
    assert [moment.path_length_m for moment in kept] == [0.0, 0.5, 1.0]
    recorder.finish(replace(view, time_s=4.3))
    assert archive.all()[-1].time_s == 4.3
    recorder.finish(replace(view, time_s=4.3))
    assert len(archive.all()) == 4
