"""Missions in the built-in house under an operator's directives."""

from pathlib import Path

import numpy as np
import pytest

from hgs_core.evaluation.trajectory import read_trajectory
from hgs_core.geometry.polygons import distance_m
from hgs_core.mission.commands import Decide, Direct, Order
from hgs_core.mission.events import ApprovalChanged, DirectivesTaken, MissionEvent, PhaseChanged, PlanMade
from hgs_core.mission.run import NoCommands, run_mission
from hgs_core.planning.directives import Directives
from hgs_core.planning.navigator import AT_GOAL_M
from hgs_core.robot.differential import DifferentialConfig
from tests.mission.test_mission import Heard, request


def way_of(folder: Path) -> np.ndarray:
    return read_trajectory(folder / "trajectory.txt").poses.translation[:, :2]


def test_a_budget_with_return_ends_at_the_start(tmp_path: Path) -> None:
    heard = Heard()
    wish = request(
        tmp_path / "run",
        time_s=60.0,
        **{
            "directives.max_path_m": "3",
            "directives.return_to_start": "true",
            "directives.max_speed_m_s": "0.5",
            "mesh.enabled": "false",
        },
    )
    report = run_mission(wish, observer=heard, commands=NoCommands())
    assert report.stop_reason == "path_budget"
    assert report.path_length_m is not None
    assert 0.5 < report.path_length_m <= 3.0
    way = way_of(tmp_path / "run")
    assert np.linalg.norm(way[-1] - way[0]) <= AT_GOAL_M
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() <= 0.5 * 0.4 + 1e-6, "0.5 m/s, a frame in 0.4 s"
    assert "path_budget" in {entry.reason for entry in report.unseen}
    assert "returning" in {event.phase for event in heard.events if isinstance(event, PhaseChanged)}
    taken = [event for event in heard.events if isinstance(event, DirectivesTaken)]
    assert len(taken) == 1
    assert taken[0].directives["max_path_m"] == 3.0


class Approver(Heard):
    """Rejects the first view, sends the robot to a candidate of its choice next, approves all others; and
    forbids what lies before the robot after a while."""

    def __init__(self, no_go: tuple) -> None:
        super().__init__()
        self._answers: list[Order] = []
        self._no_go = no_go
        self._asked = 0
        self.chosen: tuple[float, float] | None = None

    def on_event(self, event: MissionEvent) -> None:
        super().on_event(event)
        if not isinstance(event, ApprovalChanged) or event.state != "waiting":
            return
        self._asked += 1
        sequence, candidate = event.plan_sequence, None
        if self._asked == 2:
            plan = [e for e in self.events if isinstance(e, PlanMade)][-1]
            candidate = next(k for k, c in enumerate(plan.candidates) if c["status"] == "selected" and k > 0)
            self.chosen = (plan.candidates[candidate]["x_m"], plan.candidates[candidate]["y_m"])
        if self._asked == 4:
            asked = Directives(no_go=(self._no_go,), approve_views=True)
            self._answers.append(Direct(directives=asked))
            return
        self._answers.append(Decide(plan_sequence=sequence, approved=self._asked != 1, candidate=candidate))

    def poll(self) -> Order | None:
        return self._answers.pop(0) if self._answers else None


@pytest.mark.slow
def test_every_view_is_asked_for_and_no_go_areas_hold_from_the_next_step_on(tmp_path: Path) -> None:
    area = ((4.0, 1.0), (5.0, 1.0), (5.0, 2.0), (4.0, 2.0))
    operator = Approver(area)
    wish = request(
        tmp_path / "run", time_s=30.0, **{"directives.approve_views": "true", "mesh.enabled": "false"}
    )
    report = run_mission(wish, observer=operator, commands=operator)
    assert report.stop_reason == "time_limit"
    told = [(e.plan_sequence, str(e.state)) for e in operator.events if isinstance(e, ApprovalChanged)]
    assert told[:4] == [(1, "waiting"), (1, "rejected"), (2, "waiting"), (2, "approved")]
    assert (4, "not_needed") in told, "asked for something else, the mission plans anew"
    way = way_of(tmp_path / "run")
    assert operator.chosen is not None
    assert np.linalg.norm(way - np.array(operator.chosen), axis=1).min() <= AT_GOAL_M
    since = next(
        e.time_s for e in operator.events if isinstance(e, DirectivesTaken) and e.directives["no_go"]
    )
    stamps = read_trajectory(tmp_path / "run" / "trajectory.txt").timestamps_s
    after = way[stamps > since]
    inside = distance_m(np.array(area), after) < DifferentialConfig().radius_m - 0.005
    assert not inside.any() or not inside[np.argmin(inside) :].any(), "it leaves, and never comes back"
