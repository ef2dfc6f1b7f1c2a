"""A mission from above, and its past: what was seen, known and planned at moments of it."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Query, Response, status

from app.api.images import ImageKind
from app.api.views import figures, moment_entry
from app.deps import MissionDep
from app.errors import NotFound
from app.openapi import problems
from app.schemas import MomentDetail, MomentList, TopViewFacts

router = APIRouter(prefix="/missions", tags=["moments"])

_Number = Annotated[int, Path(ge=1, le=2**31 - 1, examples=[1])]
_UNCHANGING = {"Cache-Control": "private, max-age=3600, immutable"}
"""A moment never changes, and its number is never given again."""


def _picture_of(media_type: str) -> dict[int | str, dict[str, Any]]:
    return {
        200: {
            "description": "The picture",
            "content": {media_type: {"schema": {"type": "string", "format": "binary"}}},
        },
        **problems(404),
    }


@router.get("/{mission_id}/top-view", operation_id="getTopView", responses=problems(404))
def get_top_view(mission: MissionDep) -> TopViewFacts:
    """Where the newest map from above lies, and what belongs over it: trajectory, plan, subspaces."""
    drawn = mission.views.top_view()
    if drawn is None:
        raise NotFound(f"mission {mission.id} has no map (yet)")
    sequence, _, facts = drawn
    return TopViewFacts(view_sequence=sequence, **facts)


@router.get(
    "/{mission_id}/top-view.png",
    operation_id="getTopViewImage",
    response_class=Response,
    responses={
        **_picture_of("image/png"),
        304: {"description": "Still the picture that If-None-Match names"},
    },
)
def get_top_view_image(
    mission: MissionDep, if_none_match: Annotated[str | None, Header(max_length=500)] = None
) -> Response:
    """The newest map from above, without its ceiling; transparent where nothing is known."""
    tag = f'"{mission.id}-top-{mission.views.sequence}"'
    headers = {"ETag": tag, "Cache-Control": "no-cache"}
    if if_none_match is not None and tag in if_none_match:
        return Response(status_code=status.HTTP_304_NOT_MODIFIED, headers=headers)
    drawn = mission.views.top_view()
    if drawn is None:
        raise NotFound(f"mission {mission.id} has no map (yet)")
    sequence, image, _ = drawn
    headers = {**headers, "ETag": f'"{mission.id}-top-{sequence}"', "X-View-Sequence": str(sequence)}
    return Response(image, media_type="image/png", headers=headers)


@router.get("/{mission_id}/moments", operation_id="listMoments", responses=problems(404))
def list_moments(
    mission: MissionDep,
    after: Annotated[int, Query(ge=0, le=2**31 - 1, description="Only moments with a higher number")] = 0,
    limit: Annotated[int, Query(ge=1, le=1_000)] = 1_000,
) -> MomentList:
    """Moments that can be gone back to. Of a long mission they lie farther apart."""
    kept = [moment for moment in mission.views.moments.all() if moment.number > after]
    return MomentList(moments=[moment_entry(moment) for moment in kept[:limit]])


@router.get("/{mission_id}/moments/{number}", operation_id="getMoment", responses=problems(404))
def get_moment(mission: MissionDep, number: _Number) -> MomentDetail:
    """Figures, plan and map from above at that moment."""
    moment, facts = mission.views.moments.find(number), mission.views.moments.facts(number)
    if moment is None or facts is None:
        raise _gone(mission.id, number)
    return MomentDetail(
        **moment_entry(moment).model_dump(),
        figures=figures(mission.log.newest_at("telemetry", moment.sequence)),
        plan=mission.log.newest_at("plan", moment.sequence),
        top_view=TopViewFacts(view_sequence=number, **facts),
    )


@router.get(
    "/{mission_id}/moments/{number}/top-view.png",
    operation_id="getMomentTopView",
    response_class=Response,
    responses=_picture_of("image/png"),
)
def get_moment_top_view(mission: MissionDep, number: _Number) -> Response:
    """The map from above at that moment."""
    image = mission.views.moments.top_view(number)
    if image is None:
        raise _gone(mission.id, number)
    return Response(image, media_type="image/png", headers=_UNCHANGING)


@router.get(
    "/{mission_id}/moments/{number}/images/{kind}",
    operation_id="getMomentImage",
    response_class=Response,
    responses=_picture_of("image/jpeg"),
)
def get_moment_image(mission: MissionDep, number: _Number, kind: ImageKind) -> Response:
    """One of the images of that moment."""
    image = mission.views.moments.image(number, kind)
    if image is None:
        raise _gone(mission.id, number)
    return Response(image, media_type="image/jpeg", headers=_UNCHANGING)


def _gone(mission_id: str, number: int) -> NotFound:
    return NotFound(f"mission {mission_id} has no moment {number}, or it was let go")
