"""The newest images of a mission."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from fastapi import APIRouter, Header, Response, status

from app.deps import MissionDep
from app.errors import NotFound
from app.missions.display import IMAGE_KINDS
from app.openapi import problems

router = APIRouter(prefix="/missions", tags=["images"])


class ImageKind(StrEnum):
    OBSERVED = "observed"
    RENDERED = "rendered"
    DEPTH = "depth"
    QUALITY = "quality"


assert tuple(ImageKind) == IMAGE_KINDS


@router.get(
    "/{mission_id}/images/{kind}",
    operation_id="getImage",
    response_class=Response,
    responses={
        200: {
            "content": {
                kind: {"schema": {"type": "string", "format": "binary"}}
                for kind in ("image/jpeg", "image/png")
            },
            "description": "The image; ETag is its number",
        },
        304: {"description": "Still the image that If-None-Match names"},
        **problems(404),
    },
)
def get_image(
    mission: MissionDep,
    kind: ImageKind,
    if_none_match: Annotated[str | None, Header(max_length=500)] = None,
) -> Response:
    """Camera image, the map drawn from the same pose, measured depth, or quality gain of every pixel."""
    picture = mission.views.picture(kind)
    if picture is None:
        raise NotFound(f"mission {mission.id} has no images (yet)")
    tag = f'"{mission.id}-{kind}-{picture.sequence}"'
    headers = {"ETag": tag, "Cache-Control": "no-cache", "X-View-Sequence": str(picture.sequence)}
    if if_none_match is not None and tag in if_none_match:
        return Response(status_code=status.HTTP_304_NOT_MODIFIED, headers=headers)
    return Response(picture.content, media_type=picture.media_type, headers=headers)
