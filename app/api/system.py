"""The service itself."""

from __future__ import annotations

from importlib.metadata import version
from typing import Annotated

from fastapi import APIRouter, Query, Response

from app.deps import (
    AuditDep,
    DatabaseDep,
    MetricsDep,
    PrincipalDep,
    ScenesDep,
    ServiceDep,
    SettingsDep,
    SpaceDep,
)
from app.errors import Forbidden, Unavailable
from app.metrics import CONTENT_TYPE
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
def get_readiness(
    database: DatabaseDep, service: ServiceDep, space: SpaceDep, settings: SettingsDep
) -> Health:
    """Whether it can begin missions: its database can be written, the disk has room, it stays up."""
    if service.closing:
        raise Unavailable("the service shuts down")
    database.check()
    free, wanted = space.disk().free, settings.retention.room_bytes
    if free < wanted:
        raise Unavailable(f"the disk is full: {free} bytes are free, a mission needs {wanted}")
    return Health()


@health_router.get(
    "/metrics",
    operation_id="getServiceMetrics",
    response_class=Response,
    responses={
        200: {
            "description": "Prometheus' text format",
            "content": {"text/plain": {"schema": {"type": "string"}}},
        }
    },
)
def get_service_metrics(metrics: MetricsDep) -> Response:
    """What the service measures of itself, for Prometheus."""
    return Response(metrics.text(), media_type=CONTENT_TYPE)


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
