"""A mission on a disk that fills up waits and goes on by itself, and nothing that it wrote is torn."""

import errno
import json
import subprocess
import threading
import time
from pathlib import Path

import pytest

from hgs_core.mission.checkpoint import CheckpointFolder
from hgs_core.mission.events import MissionPhase
from hgs_core.mission.run import NoCommands, run_mission
from tests.mission.small_room import write_small_room
from tests.mission.test_resume import Watched, of_mission, request

DISK_MIB = 48


@pytest.fixture
def small_disk(tmp_path: Path):
    """A file system of its own that is quickly full; skipped where none can be mounted."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MIB}m", "tmpfs", str(folder)]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no file system can be mounted here: that needs root")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def fill(path: Path, left_mib: float) -> None:
    """Take all room on the disk of `path` but so much."""
    with path.open("wb") as file:
        try:
            for _ in range(int(16 * (DISK_MIB - left_mib))):
                file.write(bytes(2**16))
                file.flush()
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise


class Filling(Watched):
    """Fills the disk at a frame, and makes room again once the mission has waited for a while."""

    def __init__(self, ballast: Path, frame: int) -> None:
        super().__init__()
        self._ballast = ballast
        self._frame = frame
        self.waited = False

    def on_event(self, event) -> None:
        super().on_event(event)
        if event.kind == "telemetry" and event.frame == self._frame:
            fill(self._ballast, 1.0)
        if event.kind == "phase" and event.phase is MissionPhase.PAUSED:
            assert "is full" in event.reason
            threading.Thread(target=self._make_room).start()

    def _make_room(self) -> None:
        time.sleep(1.0)
        self.waited = True
        self._ballast.unlink()


def test_a_mission_waits_for_room_and_ends_as_on_any_disk(tmp_path: Path, small_disk: Path) -> None:
    room = write_small_room(tmp_path)
    settings = {"checkpoint.least_free_mib": "8"}
    run_mission(request(room, tmp_path / "other", time_s=8.0), observer=Watched(), commands=NoCommands())
    filling = Filling(small_disk / "ballast", 14)
    report = run_mission(
        request(room, small_disk / "run", time_s=8.0, **settings), observer=filling, commands=NoCommands()
    )
    assert report is not None
    assert report.stop_reason == "time_limit"
    assert filling.waited
    phases = [(event.phase, event.reason) for event in filling.events if event.kind == "phase"]
    paused = next(k for k, (phase, _) in enumerate(phases) if phase is MissionPhase.PAUSED)
    assert phases[paused + 1] == (MissionPhase.RUNNING, "going on: what it waited for is there")
    told = of_mission(small_disk / "run")
    assert [event for event in told if event["kind"] != "notice"] == of_mission(tmp_path / "other")
    for name in ("map.ply", "transforms.json", "trajectory.txt"):
        assert (small_disk / "run" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


def test_a_checkpoint_that_does_not_fit_leaves_the_one_before(tmp_path: Path, small_disk: Path) -> None:
    room = write_small_room(tmp_path)
    # No room is asked for: the disk fills while the mission goes on, and it dies of it in the end.
    settings = {"checkpoint.least_free_mib": "0", "checkpoint.interval_s": "1"}

    class Full(Watched):
        def on_event(self, event) -> None:
            super().on_event(event)
            if event.kind == "telemetry" and event.frame == 14:
                fill(small_disk / "ballast", 0.5)

    watched = Full()
    with pytest.raises(OSError, match="No space left"):
        run_mission(
            request(room, small_disk / "run", time_s=30.0, **settings),
            observer=watched,
            commands=NoCommands(),
        )
    assert any("no checkpoint" in e.message for e in watched.events if e.kind == "notice")
    partial = small_disk / "run.partial"
    found, _ = CheckpointFolder(partial, partial / "checkpoint").newest()
    assert found is not None
    assert not list((partial / "checkpoint").glob("*.partial"))
    for line in (partial / "events.jsonl").read_bytes().splitlines()[:-1]:
        json.loads(line)
