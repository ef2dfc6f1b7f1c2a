"""Plans as events: what the operator's page and the log read of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from hgs_core.mission.events import ApprovalChanged, ApprovalState, PlanMade
from hgs_core.planning.plan import Candidate, CandidateStatus, Plan


def plan_made(plan: Plan, why: str, *, sequence: int, time_s: float) -> PlanMade:
    """The event that tells of a plan; `why` is what the plan before it ended with."""
    return PlanMade(
        time_s=time_s,
        plan_sequence=sequence,
        reason=f"{why}: {plan.reason}",
        n_candidates=len(plan.candidates),
        n_selected=sum(c.status is CandidateStatus.SELECTED for c in plan.candidates),
        n_reconstructing=sum(s.state == "reconstructing" for s in plan.subspaces),
        path_length_m=plan.path.length_m,
        observed_share=plan.observed_share,
        planning_s=plan.times.total_s,
        viewpoint_evaluation_s=plan.times.viewpoint_evaluation_s,
        local_s=plan.times.local_s,
        global_s=plan.times.global_s,
        candidates=tuple(_candidate_json(c) for c in plan.candidates),
        coverage_unit=plan.coverage_unit,
    )


def approval(
    state: ApprovalState, plan: Plan, *, sequence: int, reason: str, time_s: float
) -> ApprovalChanged:
    """The event that tells what became of the view that a plan drives to first."""
    view = first_view(plan)
    assert view is not None  # nobody is asked about a plan that looks at nothing
    return ApprovalChanged(time_s=time_s, state=state, plan_sequence=sequence, view=view, reason=reason)


def first_view(plan: Plan) -> dict[str, float] | None:
    """Where the plan looks first; None for a plan that only drives."""
    views = np.flatnonzero(np.isfinite(plan.path.yaws_rad))
    if not len(views):
        return None
    x_m, y_m = plan.path.positions_m[views[0]].tolist()
    yaw_rad = float(plan.path.yaws_rad[views[0]])
    return {"x_m": round(x_m, 3), "y_m": round(y_m, 3), "yaw_rad": round(yaw_rad, 4)}


def _candidate_json(candidate: Candidate) -> dict[str, Any]:
    told = {
        "x_m": round(candidate.x_m, 3),
        "y_m": round(candidate.y_m, 3),
        "yaw_rad": round(candidate.yaw_rad, 4),
        "coverage": round(candidate.coverage_gain, 5),
        "quality": round(candidate.quality_gain, 5),
        "total": round(candidate.total_gain, 5),
        "status": str(candidate.status),
    }
    return {**told, "why": candidate.why} if candidate.why else told
