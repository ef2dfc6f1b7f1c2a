"""What the service is told at its start."""

from __future__ import annotations

import ipaddress
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from limits import parse
from pydantic import AfterValidator, ByteSize, Field, SecretStr
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError

from app.logs import LogLevel, LogStyle
from app.missions.moments import MomentSettings
from hgs_core.config.base import StrictConfig
from hgs_core.errors import ConfigError


class SupervisionSettings(StrictConfig):
    """How long the service waits for a mission process before it takes the next, harder step."""

    start_s: float = Field(180.0, gt=0)
    """From the start of the process to its first event [s]."""
    stop_acknowledged_s: float = Field(30.0, gt=0)
    """From STOP to the process having read it; after that it is terminated [s]."""
    finish_s: float = Field(900.0, gt=0)
    """From a read STOP to the written report [s]."""
    terminate_s: float = Field(5.0, gt=0)
    """From terminate (SIGTERM) to kill (SIGKILL) [s]."""
    shutdown_s: float = Field(15.0, gt=0)
    """How long a closing service waits for its mission to write its folder [s]."""
    orphan_s: float = Field(15.0, gt=0)
    """How long a mission process lives on after the service died [s]."""


class DisplaySettings(StrictConfig):
    """What a viewer is shown, and how often."""

    interval_s: float = Field(1.0, ge=0.05)
    """Least wall time between two views [s]."""
    max_splats: int = Field(100_000, ge=1_000, le=150_000)
    """Gaussians shown at once; of a larger map every k-th is shown, enlarged to close the gaps."""
    min_splat_m: float = Field(0.015, gt=0)
    """Least radius of a shown splat [m]: smaller ones would vanish from afar."""
    max_image_width: int = Field(640, ge=64)
    """Images shown are no wider than this [px]."""
    clip_height_m: float = Field(2.2, gt=0)
    """Splats above this height are hidden at first, so that the ceiling does not cover the rooms [m]."""


def _rate(text: str) -> str:
    parse(text)  # raises ValueError for what is not a rate
    return text


Rate = Annotated[str, AfterValidator(_rate)]
"""So many in a time, as in `60/minute`."""


class RetentionSettings(StrictConfig):
    """How long the files of finished missions stay. Without a limit they stay until the disk needs room."""

    max_bytes: ByteSize | None = Field(None, gt=0)
    """Most that missions' files may take together [B]; the oldest finished ones give up theirs first."""
    max_age_s: float | None = Field(None, gt=0)
    """Missions that ended longer ago give up their large files [s]."""
    keep_missions: int | None = Field(None, ge=1)
    """Only so many finished missions, the newest, keep their large files; pinned ones are not counted."""
    room_bytes: ByteSize = Field(ByteSize(512 * 2**20), ge=0)
    """What a new mission must find free, of the quota and on the disk [B]; otherwise it is refused."""
    interval_s: float = Field(60.0, gt=0)
    """How often that is looked after [s]; also when a mission ends and before one begins."""


class LogSettings(StrictConfig):
    style: LogStyle = LogStyle.CONSOLE
    level: LogLevel = LogLevel.INFO


class LimitSettings(StrictConfig):
    """How much one client may ask for. A client is a token, a session, or else an address."""

    requests: Rate = "6000/minute"
    changes: Rate = "300/minute"
    """Requests that change something. STOP is not counted: it passes every queue."""
    logins: Rate = "10/minute"
    """Logins tried, and wrong tokens shown, from one address."""
    body_bytes: int = Field(256 * 1024, ge=1024)
    """Largest body of a request [B]."""
    head_bytes: int = Field(32 * 1024, ge=1024)
    """Largest head of a request, all its header fields together [B]."""
    message_bytes: int = Field(4 * 1024 * 1024, ge=1024)
    """Largest message that a WebSocket client may send [B]."""
    header_s: float = Field(10.0, gt=0)
    """Until a request's head must have come [s]."""
    body_s: float = Field(20.0, gt=0)
    """Until a request's body must have come [s]."""
    send_s: float = Field(60.0, gt=0)
    """How long a client may take in nothing of what it is sent; then its connection ends [s]."""
    streams: int = Field(100, ge=1)
    """Event streams and viewers that one client may have open."""
    connections: int = Field(256, ge=8)
    """Connections from one address that have not shown a valid token or session."""


class AccessSettings(StrictConfig):
    """Who may do what. Without tokens everyone who reaches the loopback address is an operator."""

    operator_token: SecretStr | None = None
    viewer_token: SecretStr | None = None
    token_file: Path | None = None
    """Hashes of further tokens, as `hgs token` prints them."""
    allowed_hosts: tuple[str, ...] = ()
    """Names that the service answers to, beside those of the loopback address and the one it listens on."""
    session_s: float = Field(12 * 3600.0, gt=0)
    """How long a browser stays logged in [s]."""
    trusted_proxies: tuple[str, ...] = ()
    """Addresses of proxies whose X-Forwarded headers are believed."""
    open_metrics: bool = False
    """Let programs on this machine read `/metrics` without a token."""


class Settings(StrictConfig):
    """Everything `create_app` needs."""

    data_dir: Path
    """Where missions, their results and logs lie, and the database unless `database_url` names another."""
    database_url: SecretStr | None = None
    """As SQLAlchemy takes it; None: SQLite in `data_dir`."""
    scenes_dir: Path | None = None
    """Folder of meshes offered beside the built-in scenes."""
    host: str = "127.0.0.1"
    port: int = Field(8000, ge=0, le=65535)
    demo: bool = False
    """Start a mission in the built-in house as soon as the service is up."""
    demo_preset: str = "paper"
    viewer: bool = True
    """Serve the 3D viewer."""
    missions_at_once: int = Field(1, ge=1, le=64)
    """Missions that may run beside each other; further ones are queued."""
    resume_on_start: bool = False
    """Resume interrupted missions as soon as the service is up. Off by default: a robot does not begin to
    move because a computer was switched on, but because somebody who can see it said so."""
    mission_threads: int = Field(default_factory=lambda: os.cpu_count() or 1, ge=1)
    """Threads for all missions together."""
    limits: LimitSettings = LimitSettings()
    access: AccessSettings = AccessSettings()
    supervision: SupervisionSettings = SupervisionSettings()
    display: DisplaySettings = DisplaySettings()
    moments: MomentSettings = MomentSettings()
    retention: RetentionSettings = RetentionSettings()
    logs: LogSettings = LogSettings()

    @property
    def missions_dir(self) -> Path:
        return self.data_dir / "missions"

    @property
    def threads_per_mission(self) -> int:
        return max(1, self.mission_threads // self.missions_at_once)

    @property
    def database(self) -> str:
        if self.database_url is not None:
            return self.database_url.get_secret_value()
        return f"sqlite:///{self.data_dir / 'hgs.db'}"


def settings_from_environment(
    *,
    host: str,
    port: int,
    data_dir: Path,
    demo: bool,
    missions_at_once: int = 1,
    environment: Mapping[str, str] = os.environ,
) -> Settings:
    """The given options, and what `HGS_...` variables say. Raises `ConfigError` for what is not allowed."""
    told = {name: value for name, value in environment.items() if name.startswith("HGS_") and value}
    scenes, tokens = told.get("HGS_SCENES_DIR"), told.get("HGS_TOKEN_FILE")
    if scenes and not Path(scenes).is_dir():
        raise ConfigError(f"HGS_SCENES_DIR={scenes!r} is not a folder")
    if tokens and not Path(tokens).is_file():
        raise ConfigError(f"HGS_TOKEN_FILE={tokens!r} is not a file")
    return Settings(
        host=host,
        port=port,
        data_dir=data_dir.expanduser().resolve(),
        database_url=_database_url(told),
        demo=demo,
        missions_at_once=missions_at_once,
        resume_on_start=_yes(told, "HGS_RESUME_ON_START"),
        scenes_dir=Path(scenes).resolve() if scenes else None,
        access=AccessSettings(
            operator_token=_secret(told, "HGS_OPERATOR_TOKEN"),
            viewer_token=_secret(told, "HGS_VIEWER_TOKEN"),
            token_file=Path(tokens).resolve() if tokens else None,
            allowed_hosts=_words(told.get("HGS_ALLOWED_HOSTS", "")),
            trusted_proxies=_words(told.get("HGS_TRUSTED_PROXIES", "")),
            open_metrics=_yes(told, "HGS_OPEN_METRICS"),
        ),
        retention=_retention(told),
        logs=_logs(told),
    )


def _retention(told: Mapping[str, str]) -> RetentionSettings:
    given: dict[str, Any] = {}
    for name, key in (
        ("HGS_MAX_SIZE", "max_bytes"),
        ("HGS_KEEP_MISSIONS", "keep_missions"),
        ("HGS_ROOM", "room_bytes"),
        ("HGS_MAX_AGE_DAYS", "max_age_s"),
    ):
        if name not in told:
            continue
        try:
            value: Any = float(told[name]) * 86_400.0 if key == "max_age_s" else told[name]
            given[key] = getattr(RetentionSettings.model_validate({key: value}), key)
        except ValueError as error:  # pydantic's among them
            raise ConfigError(
                f"{name}={told[name]!r}: expected a number above 0"
                + (", or a size as 200GB" if name in ("HGS_MAX_SIZE", "HGS_ROOM") else "")
            ) from error
    return RetentionSettings(**given)


def _logs(told: Mapping[str, str]) -> LogSettings:
    style, level = told.get("HGS_LOG_STYLE", LogStyle.CONSOLE), told.get("HGS_LOG_LEVEL", LogLevel.INFO)
    try:
        return LogSettings(style=LogStyle(style), level=LogLevel(level))
    except ValueError as error:
        raise ConfigError(
            f"HGS_LOG_STYLE={style!s}, HGS_LOG_LEVEL={level!s}: expected one of {', '.join(LogStyle)}, "
            f"and one of {', '.join(LogLevel)}"
        ) from error


def _yes(told: Mapping[str, str], name: str) -> bool:
    word = told.get(name, "no").lower()
    if word not in ("yes", "no", "true", "false", "1", "0"):
        raise ConfigError(f"{name}={told[name]!r}: expected yes or no")
    return word in ("yes", "true", "1")


def _secret(told: Mapping[str, str], name: str) -> SecretStr | None:
    """What the variable says, or the file that `NAME_FILE` names, as container engines hand out secrets."""
    place = told.get(f"{name}_FILE")
    if place is None:
        return SecretStr(told[name]) if name in told else None
    if name in told:
        raise ConfigError(f"{name} and {name}_FILE are both set: which one is meant?")
    try:
        content = Path(place).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{name}_FILE={place!r} cannot be read: {error}") from error
    if not content:
        raise ConfigError(f"{name}_FILE={place!r} is empty")
    return SecretStr(content)


def _database_url(told: Mapping[str, str]) -> SecretStr | None:
    """With the password in its place, where it comes by itself."""
    url, password = _secret(told, "HGS_DATABASE_URL"), _secret(told, "HGS_DATABASE_PASSWORD")
    if url is None or password is None:
        return url
    try:
        parsed = make_url(url.get_secret_value()).set(password=password.get_secret_value())
    except ArgumentError as error:
        raise ConfigError("HGS_DATABASE_URL is not a URL: expected postgresql://USER@HOST/NAME") from error
    return SecretStr(parsed.render_as_string(hide_password=False))


def _words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",") if word.strip())


def is_loopback(host: str) -> bool:
    """Whether `host` can be reached from this machine alone."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def static_root() -> Path:
    """`frontend_static/` of the checkout, or its copy inside the installed package."""
    package = Path(__file__).resolve().parent
    for root in (package.parent / "frontend_static", package / "frontend_static"):
        if (root / "index.html").is_file():
            return root
    raise ConfigError(f"no operator page beside {package}: reinstall the package")
