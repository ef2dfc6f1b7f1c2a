"""Everything that a report of a fault needs, of one mission: what it was told, did, said and showed, and on
what machine. No map and no keyframes, which are large, and nothing that is secret.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import psutil

from app.missions.display import IMAGE_KINDS
from app.missions.pictures import load_view, picture_of
from app.storage.missions import Event
from app.storage.tables import MissionRecord
from hgs_core.mission.versions import software_versions
from hgs_core.native import kernels

_FROM_RUN: Final = ("config.yaml", "report.json", "report.html", "trajectory.txt", "events.jsonl")
_SERVICE_PARTS: Final = ("fastapi", "starlette", "uvicorn", "viser", "sqlalchemy", "pydantic")
_MOST_BYTES: Final = 20 * 2**20
"""Of one file: of a longer one the end is told."""
_PRIVATE: Final = frozenset({"idempotency_key", "request_digest"})


def bundle_of(
    folder: Path,
    *,
    record: MissionRecord | None = None,
    events: Iterable[Event] = (),
    service_log: Iterable[str] = (),
    settings: Mapping[str, Any] | None = None,
    remarks: Iterable[str] = (),
) -> dict[str, Path | bytes]:
    """Content by name, for `app.archive.zipped`. `folder` is the service's folder of a mission, or a run's.

    `events` are those of the database, `service_log` the newest lines of the service, `settings` the
    service's with its secrets masked, `remarks` what could not be had.
    """
    about = {
        "made_at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": {**software_versions(), **{name: version(name) for name in _SERVICE_PARTS}},
        "machine": machine_facts(folder),
        "mission": record.model_dump(mode="json", exclude=set(_PRIVATE)) if record is not None else None,
        "settings": dict(settings) if settings is not None else None,
        "remarks": list(remarks),
        "files": {path.relative_to(folder).as_posix(): path.stat().st_size for path in _listed(folder)},
    }
    content: dict[str, Path | bytes] = {"about.json": _json(about)}
    for run in (folder / "run", folder / "run.partial", folder):
        for name in _FROM_RUN:
            if name not in content and (run / name).is_file():
                content[name] = _whole_or_end(run / name)
    if (folder / "process.log").is_file():
        content["process.log"] = _whole_or_end(folder / "process.log")
    told = "".join(f"{json.dumps(event, allow_nan=False)}\n" for event in events)
    if told:
        content["service_events.jsonl"] = told.encode()
    lines = "".join(f"{line}\n" for line in service_log)
    if lines:
        content["service.log"] = lines.encode()
    view = load_view(folder / "last_view.npz")
    if view is not None:
        for kind in IMAGE_KINDS:
            picture = picture_of(view, 0, kind)
            content[f"last_view/{kind}.{picture.media_type.rpartition('/')[2]}"] = picture.content
    return content


def machine_facts(folder: Path) -> dict[str, Any]:
    """What of the machine matters to how the software runs; no name and no address of it."""
    memory, disk = psutil.virtual_memory(), psutil.disk_usage(str(_existing(folder)))
    return {
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
        "processor": _processor(),
        "processors": os.cpu_count(),
        "load_average": list(os.getloadavg()),
        "memory_bytes": memory.total,
        "memory_available_bytes": memory.available,
        "disk_bytes": disk.total,
        "disk_free_bytes": disk.free,
        "kernel_variant": kernels.variant(),
    }


def _processor() -> str | None:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), None)


def _existing(folder: Path) -> Path:
    return next(place for place in (folder, *folder.parents) if place.exists())


def _listed(folder: Path) -> list[Path]:
    """Its files but the keyframes and moments, which are many."""
    found = (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.is_symlink())
    return [path for path in found if not {"keyframes", "moments"} & set(path.parts)]


def _whole_or_end(path: Path) -> Path | bytes:
    size = path.stat().st_size
    if size <= _MOST_BYTES:
        return path
    with path.open("rb") as file:
        file.seek(size - _MOST_BYTES)
        return file.read(_MOST_BYTES)


def _json(value: Any) -> bytes:
    return json.dumps(value, indent=2, allow_nan=False, default=str).encode()
