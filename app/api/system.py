"""The service itself."""

from __future__ import annotations

from importlib.metadata import version

from fastapi import APIRouter

from app.deps import SettingsDep, ViewerDep
from app.schemas import Health, SystemInfo

router = APIRouter(tags=["system"])
health_router = APIRouter(tags=["system"])


@health_router.get("/healthz", operation_id="getHealth")
def get_health() -> Health:
    """Whether the service answers."""
    return Health()


@router.get("/system", operation_id="getSystem")
def get_system(settings: SettingsDep, viewer: ViewerDep) -> SystemInfo:
    """Version, and where the 3D scene is served."""
    return SystemInfo(
        version=version("hgs"),
        viewer_url=viewer.url if viewer is not None else None,
        min_splat_m=settings.display.min_splat_m,
        max_splats=settings.display.max_splats,
    )
