"""Databases for tests: SQLite in a folder, and a PostgreSQL of one's own."""

from __future__ import annotations

import os
import pwd
import shutil
import socket
import subprocess
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psycopg

from app.storage.tables import MissionRecord

_UNPRIVILEGED = "nobody"
"""PostgreSQL refuses to run as root; the tests may."""


def mission_record(mission_id: str, **changes) -> MissionRecord:
    """A mission in `created`."""
    given = {
        "scene": "house",
        "scene_source": "house",
        "preset": "quick",
        "preset_source": "quick",
        "seed": 0,
        "max_time_s": None,
        "overrides": {},
        "idempotency_key": None,
        "request_digest": None,
        "created_by": "anyone",
        "created_at": time.time(),
    }
    return MissionRecord(id=mission_id, **{**given, **changes})


def postgres_programs() -> Path | None:
    """Where initdb and pg_ctl of the newest installed PostgreSQL lie; None where there is none."""
    candidates = [path for path in Path("/usr/lib/postgresql").glob("*/bin") if (path / "initdb").exists()]
    if candidates:
        return max(candidates, key=lambda path: int(path.parent.name))
    found = shutil.which("initdb")
    return Path(found).parent if found else None


@contextmanager
def private_postgres(programs: Path, folder: Path) -> Iterator[str]:
    """A PostgreSQL at a free port of the loopback address; gives the URL of its server without a database."""
    folder.mkdir()
    data, log = folder / "data", folder / "log"
    as_user: list[str] = []
    if os.getuid() == 0:
        owner = pwd.getpwnam(_UNPRIVILEGED)
        os.chown(folder, owner.pw_uid, owner.pw_gid)
        as_user = ["setpriv", f"--reuid={owner.pw_uid}", f"--regid={owner.pw_gid}", "--clear-groups"]
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    options = f"-c listen_addresses=127.0.0.1 -p {port} -k {folder} -c fsync=off"
    initdb = [
        str(programs / "initdb"),
        "-D",
        str(data),
        "-U",
        "hgs",
        "-A",
        "trust",
        "-E",
        "UTF8",
        "--no-sync",
    ]
    pg_ctl = [str(programs / "pg_ctl"), "-D", str(data)]
    subprocess.run([*as_user, *initdb], check=True, capture_output=True, cwd=folder)
    subprocess.run(
        [*as_user, *pg_ctl, "-l", str(log), "-o", options, "-w", "start"],
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=folder,
    )
    try:
        yield f"postgresql://hgs@127.0.0.1:{port}"
    finally:
        stop = [*as_user, *pg_ctl, "-m", "immediate", "-w", "stop"]
        subprocess.run(stop, check=True, stdout=subprocess.DEVNULL, cwd=folder)


def fresh_database(server_url: str) -> str:
    """The URL of a new, empty database."""
    name = f"hgs_{uuid.uuid4().hex}"
    with psycopg.connect(f"{server_url}/postgres", autocommit=True) as connection:
        connection.execute(f'CREATE DATABASE "{name}"')
    return f"{server_url}/{name}"
