"""What the robot asks of the service over HTTP: a mission, how it is, and its results."""

from __future__ import annotations

import http.client
import json
import urllib.error
import urllib.parse
import urllib.request
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from app.storage.data_dir import write_whole
from hgs_core.errors import RobotError

_TIMEOUT_S: Final = 30.0
_BLOCK: Final = 2**20


class _NoRedirects(urllib.request.HTTPRedirectHandler):
    """A token is shown to the service that was named, and to no other."""

    def redirect_request(self, *_: Any, **__: Any) -> None:
        return None


class Refused(RobotError):
    """The service has answered, and says no."""

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


class ServiceApi:
    """The service at `server`, its origin: `http://HOST:PORT`.

    Every call raises `Refused` when the service does, `RobotError` when it is none, and `OSError` when it
    does not answer.
    """

    def __init__(self, server: str, token: str | None) -> None:
        """Raises `RobotError` for an address that is none."""
        parts = urllib.parse.urlsplit(server)
        if parts.scheme not in ("http", "https") or not parts.netloc:
            raise RobotError(f"--server {server!r}: expected http://HOST:PORT or https://HOST")
        self._base = f"{parts.scheme}://{parts.netloc}{parts.path.rstrip('/')}/api/v1"
        self._token = token
        self._opener = urllib.request.build_opener(_NoRedirects)

    def ingest_url(self, mission: str) -> str:
        """Where the robot of a mission connects."""
        return f"ws{self._base.removeprefix('http')}/ingest/{urllib.parse.quote(mission, safe='')}"

    def create_live_mission(self, *, preset: str, seed: int, overrides: Mapping[str, str]) -> str:
        """A new mission that waits for its robot; its id."""
        wish = {"scene": "live", "preset": preset, "seed": seed, "overrides": dict(overrides)}
        return str(self._json("POST", "/missions", wish, {"Idempotency-Key": str(uuid.uuid4())})["id"])

    def start(self, mission: str) -> None:
        self._json("POST", f"/missions/{mission}/start", {})

    def mission(self, mission: str) -> dict[str, Any]:
        """The mission's detail: `state`, `reason`, `stop_reason`, ..."""
        return self._json("GET", f"/missions/{urllib.parse.quote(mission, safe='')}")

    def results(self, mission: str) -> set[str]:
        """Names of the files that the mission has left."""
        return {str(entry["name"]) for entry in self._json("GET", f"/missions/{mission}/results")}

    def download(self, mission: str, name: str, path: Path) -> None:
        """One file of the mission, whole or not at all."""
        with self._open("GET", f"/missions/{mission}/results/{name}", None, {}) as answer:

            def write(file: Any) -> None:
                while block := answer.read(_BLOCK):
                    file.write(block)

            write_whole(path, write)

    def _json(
        self, method: str, path: str, body: object = None, headers: Mapping[str, str] | None = None
    ) -> Any:
        with self._open(method, path, body, headers or {}) as answer:
            content = answer.read()
        try:
            return json.loads(content) if content else None
        except ValueError as error:
            raise RobotError(f"{self._base}{path} did not answer with JSON: is it a service?") from error

    def _open(self, method: str, path: str, body: object, headers: Mapping[str, str]) -> Any:
        request = urllib.request.Request(
            self._base + path,
            data=None if body is None else json.dumps(body).encode(),
            headers={"Content-Type": "application/json", **headers},
            method=method,
        )
        if self._token is not None:
            request.add_header("Authorization", f"Bearer {self._token}")
        try:
            return self._opener.open(request, timeout=_TIMEOUT_S)
        except urllib.error.HTTPError as error:
            message = f"the service refuses {method} {path}: {_problem(error)}"
            raise Refused(message, error.code) from error
        except http.client.HTTPException as error:
            raise RobotError(f"{self._base} does not speak HTTP: {error!r}") from error


def _problem(error: urllib.error.HTTPError) -> str:
    """What an answer with an error status says."""
    with error:
        content = error.read(10_000)
    try:
        detail = json.loads(content).get("detail")
    except (ValueError, AttributeError):
        detail = None
    return f"HTTP {error.code}: {detail or error.reason}"
