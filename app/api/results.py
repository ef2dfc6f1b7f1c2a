"""What missions leave behind."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query
from fastapi.responses import FileResponse, StreamingResponse

from app.archive import zipped
from app.deps import MissionDep
from app.errors import NotFound
from app.missions.mission import Mission
from app.openapi import problems
from app.schemas import ResultFile

router = APIRouter(prefix="/missions", tags=["results"])

_DESCRIPTIONS = {
    "report.json": "Figures of the mission",
    "report.html": "Figures, charts and pictures of the mission, to read",
    "config.yaml": "Resolved settings, seed and versions",
    "events.jsonl": "Everything that happened, one event a line",
    "trajectory.txt": "Driven path, TUM format",
    "map.ply": "Gaussian map, opens in common splat viewers",
    "mesh.ply": "Surface mesh with coloured vertices",
    "exploration.npz": "Voxels and the planner's memory, for missions that extend the map",
    "transforms.json": "Cameras and images of the keyframes, nerfstudio layout",
    "process.log": "Output of the mission process",
}


@router.get("/{mission_id}/results", operation_id="listResults", responses=problems(404))
def list_results(mission: MissionDep) -> list[ResultFile]:
    """Files of the mission; empty until it has written them. Keyframe images are left out: transforms.json
    names them, and each can be fetched by its name."""
    return [
        ResultFile(
            name=name,
            size_bytes=path.stat().st_size,
            modified_at=path.stat().st_mtime,
            description=_DESCRIPTIONS.get(name, ""),
        )
        for name, path in _files(mission).items()
        if not name.startswith("keyframes/")
    ]


@router.get(
    "/{mission_id}/results.zip",
    operation_id="downloadResults",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "One ZIP with a folder that is named after the mission",
            "content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}},
        },
        **problems(404),
    },
)
def download_results(
    mission: MissionDep,
    keyframes: Annotated[bool, Query(description="With the images of the keyframes")] = True,
) -> StreamingResponse:
    """Everything at once: report, map, mesh, trajectory, events, settings, log and keyframes."""
    files = {
        f"{mission.id}/{name}": path
        for name, path in _files(mission).items()
        if keyframes or not name.startswith("keyframes/")
    }
    if not files:
        raise NotFound(f"mission {mission.id} has no results (yet)")
    return StreamingResponse(
        zipped(files),
        media_type="application/zip",
        headers={"Content-Disposition": f'attachment; filename="{mission.id}.zip"'},
    )


@router.get(
    "/{mission_id}/results/{name:path}",
    operation_id="getResult",
    response_class=FileResponse,
    responses={
        200: {
            "description": "The file",
            "content": {"*/*": {"schema": {"type": "string", "format": "binary"}}},
        },
        206: {"description": "The part of it that Range names"},
        416: {"description": "Range lies outside the file"},
        **problems(404),
    },
)
def get_result(mission: MissionDep, name: str) -> FileResponse:
    """Download one file: a listed one, or a keyframe's image."""
    path = _files(mission).get(name)
    if path is None:
        raise NotFound(f"mission {mission.id} has no result {name!r}")
    return FileResponse(path, filename=f"{mission.id}-{path.name}")


def _files(mission: Mission) -> dict[str, Path]:
    """Files by name, links left out. Only these can be fetched: no name leads out of the folder."""
    root = mission.results_dir
    found = {
        path.relative_to(root).as_posix(): path
        for path in sorted(root.rglob("*"))
        if path.is_file() and not path.is_symlink() and path.resolve().is_relative_to(root.resolve())
    }
    if mission.log_file.is_file():
        found[mission.log_file.name] = mission.log_file
    return found
