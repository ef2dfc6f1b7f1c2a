"""Errors of the service, and their one shape on the wire: `application/problem+json` (RFC 9457)."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.encoders import jsonable_encoder
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from hgs_core.errors import HgsError

log = logging.getLogger(__name__)

PROBLEM_MEDIA_TYPE = "application/problem+json"


class ServiceError(HgsError):
    """A request that cannot be served; `status` is its HTTP status."""

    status = 500
    title = "The service failed"

    def __init__(self, detail: str, *, errors: Sequence[Mapping[str, Any]] = ()) -> None:
        super().__init__(detail)
        self.detail = detail
        self.errors = tuple(errors)


class NotFound(ServiceError):
    status = 404
    title = "Not found"


class Conflict(ServiceError):
    status = 409
    title = "Not possible now"


class Invalid(ServiceError):
    status = 422
    title = "The request is not valid"


class Forbidden(ServiceError):
    status = 403
    title = "Refused"


def problem(
    request: Request,
    *,
    status: int,
    title: str,
    detail: str,
    errors: Sequence[Mapping[str, Any]] = (),
    headers: Mapping[str, str] | None = None,
) -> JSONResponse:
    """A problem document. `errors` holds `{field, value, message, allowed?}` entries."""
    content: dict[str, Any] = {
        "type": "about:blank",
        "title": title,
        "status": status,
        "detail": detail,
        "instance": request.url.path,
    }
    if errors:
        content["errors"] = jsonable_encoder(list(errors))
    return JSONResponse(
        content, status_code=status, media_type=PROBLEM_MEDIA_TYPE, headers=dict(headers) if headers else None
    )


def install_error_handlers(app: FastAPI) -> None:
    """Make every error of `app` a problem document."""

    async def service_error(request: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, ServiceError)
        return problem(
            request, status=error.status, title=error.title, detail=error.detail, errors=error.errors
        )

    async def domain_error(request: Request, error: Exception) -> JSONResponse:
        return problem(request, status=422, title=Invalid.title, detail=str(error))

    async def validation_error(request: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, RequestValidationError)
        errors = [_field_error(entry) for entry in error.errors()]
        detail = "; ".join(f"{entry['field']}: {entry['message']}" for entry in errors)
        return problem(request, status=422, title=Invalid.title, detail=detail, errors=errors)

    async def http_error(request: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, HTTPException)
        return problem(
            request,
            status=error.status_code,
            title=str(error.detail),
            detail=f"{request.method} {request.url.path}: {error.detail}",
            headers=error.headers,
        )

    async def unexpected_error(request: Request, error: Exception) -> JSONResponse:
        log.exception("unexpected error in %s %s", request.method, request.url.path, exc_info=error)
        return problem(
            request,
            status=500,
            title=ServiceError.title,
            detail=f"{type(error).__name__}: see the service's log",
        )

    app.add_exception_handler(ServiceError, service_error)
    app.add_exception_handler(HgsError, domain_error)
    app.add_exception_handler(RequestValidationError, validation_error)
    app.add_exception_handler(HTTPException, http_error)
    app.add_exception_handler(Exception, unexpected_error)


def _field_error(entry: Mapping[str, Any]) -> dict[str, Any]:
    place = [str(part) for part in entry["loc"] if part not in ("body", "query", "path", "header")]
    value = entry.get("input")
    found: dict[str, Any] = {
        "field": ".".join(place) or str(entry["loc"][0]),
        "value": value if isinstance(value, str | int | float | bool | None) else str(value)[:200],
        "message": entry["msg"],
    }
    allowed = {
        key: bound for key, bound in (entry.get("ctx") or {}).items() if isinstance(bound, str | int | float)
    }
    if allowed:
        found["allowed"] = allowed
    return found
