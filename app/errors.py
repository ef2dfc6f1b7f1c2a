"""Errors of the service, and their one shape on the wire: `application/problem+json` (RFC 9457)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.encoders import jsonable_encoder
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from hgs_core.errors import HgsError

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


class Unauthorized(ServiceError):
    status = 401
    title = "Log in first"


class Forbidden(ServiceError):
    status = 403
    title = "Refused"


class TooMany(ServiceError):
    status = 429
    title = "Too many requests"

    def __init__(self, detail: str, *, retry_after_s: int) -> None:
        super().__init__(detail)
        self.retry_after_s = retry_after_s


class HeadTooLarge(ServiceError):
    status = 431
    title = "Request header fields too large"


class NoRoom(ServiceError):
    status = 507
    title = "No room"


class Unavailable(ServiceError):
    status = 503
    title = "Not available now"


class _ProblemResponse(JSONResponse):
    """In ASCII: what was refused may hold what has no UTF-8, half a surrogate pair for one."""

    media_type = PROBLEM_MEDIA_TYPE

    def render(self, content: Any) -> bytes:
        return json.dumps(content, allow_nan=False).encode("ascii")


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
    return _ProblemResponse(content, status_code=status, headers=dict(headers) if headers else None)


def problem_of(request: Request, error: ServiceError) -> JSONResponse:
    """The problem document of a service error."""
    headers = {}
    if isinstance(error, TooMany):
        headers["Retry-After"] = str(error.retry_after_s)
    if isinstance(error, Unauthorized):
        headers["WWW-Authenticate"] = "Bearer"
    return problem(
        request,
        status=error.status,
        title=error.title,
        detail=error.detail,
        errors=error.errors,
        headers=headers,
    )


def install_error_handlers(app: FastAPI) -> None:
    """Make every expected error of `app` a problem document; the gate does so with the others."""

    async def service_error(request: Request, error: Exception) -> JSONResponse:
        assert isinstance(error, ServiceError)
        return problem_of(request, error)

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

    app.add_exception_handler(ServiceError, service_error)
    app.add_exception_handler(HgsError, domain_error)
    app.add_exception_handler(RequestValidationError, validation_error)
    app.add_exception_handler(HTTPException, http_error)


def _printable(value: Any) -> Any:
    """A value as a problem tells it: strict JSON, and no longer than anybody reads."""
    if value is None or isinstance(value, bool | int) or (isinstance(value, float) and math.isfinite(value)):
        return value
    return str(value)[:200]


def _field_error(entry: Mapping[str, Any]) -> dict[str, Any]:
    place = [str(part) for part in entry["loc"] if part not in ("body", "query", "path", "header")]
    value = entry.get("input")
    found: dict[str, Any] = {
        "field": ".".join(place) or str(entry["loc"][0]),
        "value": _printable(value),
        "message": entry["msg"],
    }
    allowed = {
        key: bound for key, bound in (entry.get("ctx") or {}).items() if isinstance(bound, str | int | float)
    }
    if allowed:
        found["allowed"] = allowed
    return found
