"""The description of the interface, complete enough to generate a client from."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any, Final

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from app.errors import PROBLEM_MEDIA_TYPE
from app.schemas import Problem
from app.security.access import COOKIE, SESSION_PATH

_OPEN: Final = ("/healthz", "/readyz", SESSION_PATH)
_DESCRIPTION: Final = """\
Missions of a robot that explores an unknown building and maps it with 3D Gaussians: create, command, watch.

Lengths are in metres, times in seconds (`..._at`: Unix time), angles in degrees. Errors are problem
documents (RFC 9457). Live events come over a WebSocket at
`/api/v1/missions/{mission_id}/events?after=SEQUENCE`, one JSON object a message, or as server-sent events
(`streamEvents`); both go on after the sequence number that they are given, and leave out telemetry, but no
change of state, for a reader that falls behind.
"""
_WHY: Final = {
    400: "The request cannot be read",
    401: "No token or session was shown, or it does not hold (any more)",
    403: "The role does not allow it, or it came from another site's page",
    404: "There is no such thing",
    408: "The body did not come in time",
    409: "Not possible in the present state",
    413: "The body is too large",
    422: "A value is not allowed; `errors` names the field",
    431: "The head of the request is too large",
    429: "Too many requests; Retry-After says when to come again",
    503: "The database or a resource does not answer now",
    507: "The disk, or the quota of missions' files, leaves no room",
}


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """`responses` of a route: these statuses, as problem documents."""
    schema = {"$ref": "#/components/schemas/Problem"}
    return {
        status: {
            "description": _WHY.get(status, HTTPStatus(status).phrase),
            "content": {PROBLEM_MEDIA_TYPE: {"schema": schema}},
        }
        for status in statuses
    }


def install_openapi(app: FastAPI) -> None:
    """Make `app.openapi()` tell what every operation needs and how it can fail."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _described(
                get_openapi(
                    title=app.title,
                    version=app.version,
                    description=_DESCRIPTION,
                    routes=app.routes,
                    separate_input_output_schemas=False,
                )
            )
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _described(schema: dict[str, Any]) -> dict[str, Any]:
    components = schema.setdefault("components", {})
    schemas = components.setdefault("schemas", {})
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    model = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas.update(model.pop("$defs"))
    schemas["Problem"] = model
    components["securitySchemes"] = {
        "bearer": {"type": "http", "scheme": "bearer", "description": "For programs"},
        "session": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "For browsers"},
    }
    for path, operations in schema["paths"].items():
        for operation in operations.values():
            _describe(path, operation)
    return schema


def _describe(path: str, operation: dict[str, Any]) -> None:
    common = [401, 403, 429, 431]  # 401 also where no login is needed: a wrong token is never passed over
    if path not in _OPEN:
        operation["security"] = [{"bearer": []}, {"session": []}]
    if path not in ("/healthz",):
        common.append(503)
    if "requestBody" in operation:
        common += [400, 408, 413]
    if "parameters" in operation or "requestBody" in operation:
        common.append(422)
    told = operation["responses"]
    if "422" in told and "$ref" not in str(told["422"].get("content", {}).get(PROBLEM_MEDIA_TYPE, "")):
        del told["422"]  # FastAPI's own shape, which is not what is sent
    for status, answer in problems(*common).items():
        told.setdefault(str(status), answer)
    operation["responses"] = dict(sorted(told.items()))
