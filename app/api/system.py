"""The service itself."""

from __future__ import annotations

from importlib.metadata import version
from typing import Annotated

from fastapi import APIRouter, Query

from app.deps import AuditDep, DatabaseDep, PrincipalDep, ScenesDep, SettingsDep
from app.errors import Forbidden
from app.openapi import problems
from app.schemas import AuditEntry, AuditPage, Health, SystemInfo
from app.security.principal import Role

router = APIRouter(tags=["system"])
health_router = APIRouter(tags=["system"])


@health_router.get("/healthz", operation_id="getHealth")
def get_health() -> Health:
    """Whether the service answers."""
    return Health()


@health_router.get("/readyz", operation_id="getReadiness", responses=problems(503))
def get_readiness(database: DatabaseDep) -> Health:
    """Whether it can work: its database answers."""
    database.check()
    return Health()


@router.get("/system", operation_id="getSystem")
def get_system(settings: SettingsDep, scenes: ScenesDep) -> SystemInfo:
    """Version, and what the viewer shows."""
    return SystemInfo(
        version=version("hgs"),
        viewer=scenes is not None,
        min_splat_m=settings.display.min_splat_m,
        max_splats=settings.display.max_splats,
    )


@router.get("/audit", operation_id="listAudit")
def list_audit(
    audit: AuditDep,
    principal: PrincipalDep,
    limit: Annotated[int, Query(ge=1, le=1_000)] = 100,
    before: Annotated[
        int | None, Query(ge=1, le=2**53, description="`next_before` of the page before")
    ] = None,
) -> AuditPage:
    """Who tried to change what, newest first. For operators."""
    if principal.role is not Role.OPERATOR:
        raise Forbidden(f"{principal.name} is a {principal.role}; the audit is for operators")
    found = audit.page(limit + 1, before=before)
    entries = [AuditEntry(**record.model_dump()) for record in found[:limit]]
    more = len(found) > limit
    return AuditPage(entries=entries, next_before=entries[-1].id if more else None)
