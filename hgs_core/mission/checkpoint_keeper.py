"""When a mission takes its checkpoints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hgs_core.errors import CheckpointError
from hgs_core.mission.checkpoint import CheckpointFolder
from hgs_core.mission.checkpoint_config import CheckpointConfig
from hgs_core.mission.mission import Mission


@dataclass(frozen=True, kw_only=True)
class CheckpointTold:
    """One that is kept now, or the `problem` that there was."""

    saved_s: float
    """Mission time that it was taken at."""
    size_bytes: int = 0
    took_s: float = 0.0
    problem: str | None = None


class CheckpointKeeper:
    """Takes a checkpoint whenever one is due, and tells of it; to be called between two frames.

    A checkpoint is due `interval_s` of mission time after the last one, or later: when all of them together
    have held up the mission for no more than `most_share` of its wall time.
    """

    def __init__(
        self,
        folder: CheckpointFolder,
        config: CheckpointConfig,
        *,
        mission: Mission,
        kept_s: float | None,
        state: Callable[[], Mapping[str, Any]],
        files: Callable[[], Sequence[Path]],
        tell: Callable[[CheckpointTold], None],
    ) -> None:
        """`kept_s`: mission time of the checkpoint that the mission goes on from, if it does. `state` and
        `files` are what a checkpoint of this moment holds and refers to."""
        self._folder = folder
        self._config = config
        self._mission = mission
        self._state = state
        self._files = files
        self._tell = tell
        self._last_s = mission.time_s
        self._kept_s = kept_s
        self._began_s = mission.wall_s
        self._spent_s = 0.0
        self._under_way: CheckpointTold | None = None
        self._failed = False

    def between_frames(self) -> None:
        """Never raises for a full disk: that is told, and tried again after the next interval."""
        if self._under_way is not None and not self._folder.busy:
            self._settle()
        if self._is_due():
            self.save()

    def save(self) -> None:
        """Take one now, due or not."""
        self._settle()
        began_s, time_s = self._mission.wall_s, self._mission.time_s
        self._last_s = time_s
        try:
            size = self._begin()
        except (OSError, CheckpointError) as error:
            self._spent_s += self._mission.wall_s - began_s
            self._complain(error)
            return
        took_s = self._mission.wall_s - began_s
        self._spent_s += took_s
        self._under_way = CheckpointTold(saved_s=time_s, size_bytes=size, took_s=took_s)

    def finish(self) -> float | None:
        """Wait for what is under way; the mission time of the newest that is kept, None where none is."""
        self._settle()
        return self._kept_s

    def _begin(self) -> int:
        state, files = self._state(), self._files()
        try:
            return self._folder.begin(state, files)
        except OSError:
            if not self._folder.make_room():
                raise
        return self._folder.begin(state, files)

    def _is_due(self) -> bool:
        config, passed_s = self._config, self._mission.time_s - self._last_s
        if config.interval_s <= 0 or passed_s < config.interval_s or self._folder.busy:
            return False
        return self._spent_s <= config.most_share * (self._mission.wall_s - self._began_s)

    def _settle(self) -> None:
        told, self._under_way = self._under_way, None
        try:
            self._folder.finish()
        except OSError as error:
            self._complain(error)
            return
        if told is not None:
            self._kept_s = told.saved_s
            self._failed = False
            self._tell(told)

    def _complain(self, error: Exception) -> None:
        """Once, until one can be written again."""
        if not self._failed:
            self._failed = True
            kept = (
                f"the one of {self._kept_s:.1f} s stays" if self._kept_s is not None else "there is none yet"
            )
            self._tell(CheckpointTold(saved_s=self._last_s, problem=f"no checkpoint: {error}; {kept}"))
