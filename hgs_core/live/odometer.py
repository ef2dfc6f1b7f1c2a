"""What a robot has driven and touched since the mission began."""

from __future__ import annotations

from typing import Any

from hgs_core.live.messages import Report


class Odometer:
    """Over all lives of a robot's program, which may count from 0 again."""

    def __init__(self, first: Report) -> None:
        self._newest = (first.path_length_m, first.collisions)
        self._before = (-first.path_length_m, -first.collisions)

    def take(self, report: Report) -> None:
        path_m, collisions = self._newest
        if report.path_length_m < path_m - 1e-6 or report.collisions < collisions:
            self._before = (self._before[0] + path_m, self._before[1] + collisions)
        self._newest = (report.path_length_m, report.collisions)

    def totals(self) -> tuple[float, int]:
        return self._before[0] + self._newest[0], self._before[1] + self._newest[1]

    def state(self) -> dict[str, Any]:
        return {"before": list(self._before), "newest": list(self._newest)}

    def restore(self, state: dict[str, Any]) -> None:
        (path_m, collisions), (now_m, now_collisions) = state["before"], state["newest"]
        self._before, self._newest = (path_m, collisions), (now_m, now_collisions)
