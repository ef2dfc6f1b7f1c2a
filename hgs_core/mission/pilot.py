"""`Pilot`: what the robot does next, from the first look around to the place where the mission ends.

It asks the planner, waits for the operator's word where that is wanted, leaves no-go areas, drives back to
the start, and decides that the mission is over.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from hgs_core.mapping.mapper import Mapper
from hgs_core.mission.bounds import Bounds, asks_for_another_plan
from hgs_core.mission.clock import Clock
from hgs_core.mission.config import MissionLimits
from hgs_core.mission.detour import Detour, Ending
from hgs_core.mission.events import (
    ApprovalState,
    DirectivesTaken,
    Halted,
    MissionEvent,
    MissionPhase,
    Notice,
    PhaseChanged,
    StopReason,
)
from hgs_core.mission.helm import Helm
from hgs_core.mission.operator import Operator
from hgs_core.mission.standstill import Standstill
from hgs_core.mission.telling import approval, first_view, plan_made
from hgs_core.planning.directives import Directives
from hgs_core.planning.navigator import Navigator
from hgs_core.planning.plan import (
    NothingLeft,
    Plan,
    Planner,
    PlanningTimes,
    UnseenReason,
)
from hgs_core.robot.robot import Robot
from hgs_core.robot.vehicle import Vehicle


class Pilot:
    """Decides after every frame; the robot stands whenever it has decided nothing."""

    def __init__(
        self,
        *,
        robot: Robot,
        vehicle: Vehicle,
        mapper: Mapper,
        planner: Planner,
        planner_rng: np.random.Generator,
        navigator: Navigator,
        limits: MissionLimits,
        clock: Clock,
        operator: Operator,
        directives: Directives,
        why_over: Callable[[], str | None],
        tell: Callable[[MissionEvent], None],
    ) -> None:
        self.plan: Plan | None = None
        """The newest one."""
        self.planning: list[PlanningTimes] = []
        self.missing_volume_m3 = 0.0
        """Where it is worth seeing, when the newest plan was made."""
        self.ended: Ending | None = None
        self._robot = robot
        self._vehicle = vehicle
        self._mapper = mapper
        self._planner = planner
        self._planner_rng = planner_rng
        self._navigator = navigator
        self._limits = limits
        self._clock = clock
        self._operator = operator
        self._why_over = why_over
        self._tell = tell
        self._bounds = Bounds(directives, robot=robot, mapper=mapper, planner=planner, navigator=navigator)
        self._plan_sequence = 0
        self._awaits_approval = False
        self._why_replan: str | None = None
        """Set between two plans: why there must be another, whatever the planner thinks of its own."""
        self._detour: Detour | None = None
        self._ending: Ending | None = None
        """Decided on; what is left is the way back."""
        self._standstill = Standstill()
        self._helm = Helm(robot)

    def begin(self) -> None:
        """Look around, as far as the vehicle can without knowing anything; with an old map there is a plan at
        once."""
        if self._bounds.directives != Directives():
            self._bounds.keep_to(self._bounds.directives)
            self.obey(self._bounds.directives)
        if self._mapper.gaussians.size == 0:
            self._helm.follow(self._vehicle.first_look(self._robot.state))

    def obey(self, directives: Directives) -> None:
        """Take these as what is asked of the mission from now on, and say what of it cannot be kept."""
        if asks_for_another_plan(self._bounds.directives, directives):
            self._why_replan = "the operator asks for something else"
            self._bounds.keep_to(directives)
        self._bounds.directives = directives
        self._robot.limit_speed(directives.max_speed_m_s)
        told = directives.model_dump(mode="json")
        self._tell(DirectivesTaken(time_s=self._time_s, directives=told))
        for message in self._bounds.what_cannot_be_kept():
            self._notice(message)

    def halt(self) -> None:
        """Let the robot stand, for good. From any thread: what the loop is busy with (a frame that is taken
        in, a plan that is made) is not waited for, and nothing that it does afterwards moves the robot.
        """
        state = self._helm.halt()
        self._tell(
            Halted(
                time_s=state.timestamp_s,
                at_s=time.time(),
                x_m=state.x_m,
                y_m=state.y_m,
                yaw_rad=state.yaw_rad,
            )
        )

    def hold(self, why_on: str) -> None:
        """Let the robot stand until the next decision, which makes another plan: `why_on` says why."""
        self._robot.stop()
        if self.plan is not None and not self._awaits_approval:
            self._why_replan = why_on

    def decide(self) -> None:
        """After a frame has been taken in: whether the mission is over, and else what to drive to."""
        if not self.should_end():
            self._plan_if_needed()

    def should_end(self) -> bool:
        """Whether the mission is over now."""
        if self.ended is not None:
            return True
        if self._operator.stop_requested:
            self._end(self._ended_by(StopReason.INTERRUPTED, "stopped by command"))
        elif (over := self._why_over()) is not None:
            self._end(self._ended_by(StopReason.STREAM_ENDED, over))
        elif self._ending is not None:
            pass  # on the way back, which `_drive_back` brings to its end
        elif self._time_s >= self._limits.max_time_s:
            limit = f"time limit of {self._limits.max_time_s:.0f} s reached"
            self._finish(self._ended_by(StopReason.TIME_LIMIT, limit, UnseenReason.TIME_LIMIT))
        elif self._standstill.plans >= self._limits.stuck_after_plans:
            stuck = f"{self._standstill.plans} plans in a row without moving"
            self._finish(self._ended_by(StopReason.STUCK, stuck))
        return self.ended is not None

    def live_through(self, duration_s: float) -> None:
        """The robot goes on with what it does for so much mission time."""
        if duration_s > 0:
            with self._clock.stopped():
                self._robot.advance(duration_s)

    @property
    def directives(self) -> Directives:
        """What is asked of the mission now."""
        return self._bounds.directives

    @property
    def phase(self) -> MissionPhase:
        """What the mission does when it is not paused."""
        if self._ending is not None:
            return MissionPhase.RETURNING
        return MissionPhase.AWAITING_APPROVAL if self._awaits_approval else MissionPhase.RUNNING

    @property
    def awaits(self) -> str | None:
        """What it waits for, in words; None when it does not wait."""
        if not self._awaits_approval or self.plan is None or (view := first_view(self.plan)) is None:
            return None
        return (
            f"waits for the operator to approve the view at ({view['x_m']:.1f}, {view['y_m']:.1f}) of plan "
            f"{self._plan_sequence}"
        )

    def state(self) -> dict[str, Any]:
        """All that later decisions depend on but planner, robot and maps, as plain data."""
        detour, ending = self._detour, self._ending
        return {
            "asked": self._operator.state(),
            "bounds": self._bounds.state(),
            "plan": None if self.plan is None else self.plan.state(),
            "plan_sequence": self._plan_sequence,
            "awaits_approval": self._awaits_approval,
            "why_replan": self._why_replan,
            "detour": None if detour is None else detour.state(),
            "ending": None if ending is None else ending.state(),
            "navigator": self._navigator.state(),
            "missing_volume_m3": self.missing_volume_m3,
            "standstill": self._standstill.state(),
        }

    def restore(self, state: dict[str, Any], *, planning: list[PlanningTimes]) -> None:
        """Go on from `state`; `planning` is the record's. To be called before the planner is restored."""
        self.planning = planning
        self._bounds.restore(state["bounds"])
        self._operator.restore(state["asked"])
        self.plan = None if state["plan"] is None else Plan.restore(state["plan"])
        self._plan_sequence = int(state["plan_sequence"])
        self._awaits_approval = bool(state["awaits_approval"])
        self._why_replan = state["why_replan"]
        self._detour = None if state["detour"] is None else Detour.restore(state["detour"])
        self._ending = None if state["ending"] is None else Ending.restore(state["ending"])
        self._navigator.restore(state["navigator"])
        self.missing_volume_m3 = float(state["missing_volume_m3"])
        self._standstill.restore(state["standstill"])

    @property
    def _time_s(self) -> float:
        return self._robot.state.timestamp_s

    def _plan_if_needed(self) -> None:
        reason = None if self._awaits_approval else self._why_plan()
        # By a real clock the robot has driven on while the frame that this was decided on was taken in.
        self.live_through(self._clock.elapsed_s(nominal_s=0.0))
        if self._awaits_approval:
            reason = self._settle_approval()
        if reason is None:
            return
        self._robot.stop()
        self.live_through(self._robot.standing_in_s)
        self._why_replan = self._detour = None
        if self._ending is not None:
            self._drive_back(self._ending)
        elif not self._leaves_no_go():
            self._follow_new_plan(reason)

    def _why_plan(self) -> str | None:
        if self.plan is None and self._detour is None:
            return "first look finished" if self._robot.arrived else None
        if self._why_replan is not None:
            return self._why_replan
        snapshot, state, passed = self._mapper.snapshot(), self._robot.state, self._robot.waypoints_passed
        if self._detour is not None:
            if self._robot.arrived:
                return self._detour.done
            leaving = self._detour.leaving
            return self._navigator.why_blocked(snapshot, state, self._detour.path, passed, leaving=leaving)
        assert self.plan is not None
        if np.isfinite(self.plan.path.yaws_rad[:passed]).any():
            return "viewpoint taken"
        if self._robot.arrived:
            return "arrived"
        return self._planner.should_replan(snapshot, state, self.plan, passed)

    def _follow_new_plan(self, why: str) -> None:
        answer = self._planner.plan(self._mapper.snapshot(), self._robot.state, self._planner_rng)
        self.planning.append(answer.times)
        voxels = self._mapper.voxels
        self.missing_volume_m3 = self._navigator.n_missing(voxels) * voxels.config.size_m**3
        if isinstance(answer, NothingLeft):
            reason, message = self._why_nothing_is_left(), answer.reason
            if reason is StopReason.PATH_BUDGET:
                message = (
                    f"the path budget of {self._bounds.directives.max_path_m:g} m lasts no longer: {message}"
                )
            self._finish(Ending(reason=reason, message=message, unseen=answer.unseen))
            return
        self._standstill.note(self._robot.state)
        if self._bounds.enters_no_go(answer):
            self._notice("the way to the next view would brush a no-go area: it is not driven")
            self._why_replan = "the way would have brushed a no-go area"
            return
        plan = self._bounds.within(answer)
        if plan is None:
            message = "what is left of the path budget does not lead to the next view"
            self._finish(self._ended_by(StopReason.PATH_BUDGET, message, UnseenReason.PATH_BUDGET))
            return
        self.plan = plan
        self._plan_sequence += 1
        self.live_through(self._clock.elapsed_s(nominal_s=self._limits.planning_time_s))
        asks = self._bounds.directives.approve_views and first_view(plan) is not None
        if not asks:
            # The robot waits at the view until a frame has seen what was to be seen there, and the next plan.
            self._helm.follow(plan.path.to_first_view())
        self._tell(plan_made(plan, why, sequence=self._plan_sequence, time_s=self._time_s))
        if asks:
            self._awaits_approval = True
            self._tell_approval(plan, ApprovalState.WAITING, "the operator is asked")
            self._announce(self.awaits or "")

    def _why_nothing_is_left(self) -> StopReason:
        """Whether nothing is left to see, or nothing that the path budget lasts for."""
        if self._bounds.directives.max_path_m is None:
            return StopReason.COMPLETE
        self._planner.obey(
            self._bounds.directives.model_copy(update={"max_path_m": None}), self._bounds.start_m
        )
        without = self._planner.plan(self._mapper.snapshot(), self._robot.state, self._planner_rng)
        return StopReason.COMPLETE if isinstance(without, NothingLeft) else StopReason.PATH_BUDGET

    def _settle_approval(self) -> str | None:
        """Act on the operator's word, if there is any; why there must be another plan, or None."""
        assert self.plan is not None
        snapshot, state, plan = self._mapper.snapshot(), self._robot.state, self.plan
        stale = self._why_replan or self._planner.should_replan(snapshot, state, plan, 0)
        if stale is not None:
            self._awaits_no_more(plan, ApprovalState.NOT_NEEDED, stale)
            return stale
        if not self._bounds.directives.approve_views:
            self._awaits_no_more(plan, ApprovalState.NOT_NEEDED, "views need no approval any more")
            self._helm.follow(plan.path.to_first_view())
            return None
        decision = self._operator.take_decision(self._plan_sequence)
        if decision is None:
            return None
        if not decision.approved:
            self._planner.refuse(snapshot, **(first_view(plan) or {}))
            self._standstill.forgive()
            self._awaits_no_more(plan, ApprovalState.REJECTED, "view rejected by the operator")
            return "view rejected by the operator"
        if decision.candidate is not None:
            chosen = self._towards_candidate(plan, decision.candidate)
            if chosen is None:
                return None
            self.plan = plan = chosen
        self._awaits_no_more(plan, ApprovalState.APPROVED, "view approved by the operator")
        self._helm.follow(plan.path.to_first_view())
        return None

    def _towards_candidate(self, plan: Plan, index: int) -> Plan | None:
        """The plan with the way to another of its candidates; None, and a notice, where there is none."""
        if not 0 <= index < len(plan.candidates):
            self._notice(f"plan {self._plan_sequence} has no candidate {index}")
            return None
        chosen = plan.candidates[index]
        goal_m = np.array([chosen.x_m, chosen.y_m])
        way = self._navigator.way_to(self._mapper.snapshot(), self._robot.state, goal_m)
        redirected = None
        if way is not None:
            redirected = self._bounds.within(self._bounds.redirected(plan, way, chosen.yaw_rad))
        if redirected is None:
            why = "no way there is known" if way is None else "the path budget does not last for it"
            place = f"({chosen.x_m:.1f}, {chosen.y_m:.1f})"
            self._notice(f"the robot cannot be sent to candidate {index} at {place}: {why}")
        return redirected

    def _awaits_no_more(self, plan: Plan, state: ApprovalState, reason: str) -> None:
        self._awaits_approval = False
        self._tell_approval(plan, state, reason)
        self._announce(reason)

    def _leaves_no_go(self) -> bool:
        """Whether the robot stands in a no-go area, and drives out of it now if it can."""
        state = self._robot.state
        if not self._navigator.stands_in_no_go(state.x_m, state.y_m):
            return False
        self._standstill.note(self._robot.state)
        way = self._navigator.way_out(self._mapper.snapshot(), state)
        if way is not None:
            self._take(Detour(path=way, done="the robot has left the no-go area", leaving=True))
        return True

    def _finish(self, ending: Ending) -> None:
        """End the mission: at once, or once the robot is back where that is asked for."""
        if not self._bounds.directives.return_to_start or self._bounds.is_back:
            self._end(ending)
            return
        self._robot.stop()
        self._ending = ending
        self._standstill.forgive()
        self._announce(f"drives back to the start: {ending.message}")
        self._drive_back(ending)

    def _drive_back(self, ending: Ending) -> None:
        state = self._robot.state
        if self._bounds.is_back:
            self._end(replace(ending, message=f"{ending.message}; back at the start"))
            return
        self._standstill.note(self._robot.state)
        if not self._bounds.directives.return_to_start:
            self._end(ending)
        elif self._standstill.plans >= self._limits.stuck_after_plans:
            lost = f"no way back to the start is known from ({state.x_m:.1f}, {state.y_m:.1f})"
            self._notice(lost)
            self._end(replace(ending, message=f"{ending.message}; {lost}"))
        elif not self._leaves_no_go():
            way = self._navigator.way_back(
                self._mapper.snapshot(), state, self._bounds.start_m, self._bounds.left_m
            )
            if way is not None:
                self._take(Detour(path=way, done="at the end of the way back", leaving=False))

    def _take(self, detour: Detour) -> None:
        self._detour = detour
        self._helm.follow(detour.path)

    def _end(self, ending: Ending) -> None:
        self._robot.stop()
        if self._awaits_approval and self.plan is not None:
            self._awaits_approval = False
            self._tell_approval(self.plan, ApprovalState.NOT_NEEDED, ending.message)
        self.ended = ending

    def _ended_by(
        self, reason: StopReason, message: str, cut_short: UnseenReason = UnseenReason.INTERRUPTED
    ) -> Ending:
        """An ending with what is unseen; regions still to be visited get `cut_short` as their reason."""
        unseen = tuple(
            replace(region, reason=cut_short) if region.reason is UnseenReason.INTERRUPTED else region
            for region in self._planner.unseen(self._mapper.snapshot(), self._robot.state)
        )
        return Ending(reason=reason, message=message, unseen=unseen)

    def _tell_approval(self, plan: Plan, state: ApprovalState, reason: str) -> None:
        self._tell(approval(state, plan, sequence=self._plan_sequence, reason=reason, time_s=self._time_s))

    def _announce(self, reason: str) -> None:
        self._tell(PhaseChanged(time_s=self._time_s, phase=self.phase, reason=reason))

    def _notice(self, message: str) -> None:
        self._tell(Notice(time_s=self._time_s, level="warning", message=message))
