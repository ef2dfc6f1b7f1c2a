"""The container files keep to their own rules: no engine is at hand to try them."""

from __future__ import annotations

import inspect
import re
import shutil
import subprocess
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml

from app import settings

DOCKERFILES = ["Dockerfile", "Dockerfile.cuda"]
SERVICE_KEYS = {
    *("build", "image", "command", "environment", "secrets", "volumes", "ports", "depends_on", "restart"),
    *("stop_grace_period", "init", "read_only", "tmpfs", "shm_size", "cap_drop", "security_opt", "logging"),
    *("healthcheck",),
}


@pytest.fixture(scope="module")
def docker(repository: Path) -> Path:
    return repository / "docker"


@pytest.fixture(scope="module")
def compose(docker: Path) -> dict:
    return yaml.safe_load((docker / "compose.yaml").read_text(encoding="utf-8"))


def instructions(path: Path) -> list[tuple[str, str]]:
    text = re.sub(r"^\s*#.*\n", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [(line.split(maxsplit=1)[0], line.split(maxsplit=1)[1]) for line in lines if line.strip()]


@pytest.mark.parametrize("name", DOCKERFILES)
def test_images_run_as_nobody_in_particular_and_say_how_they_are(docker: Path, name: str) -> None:
    found = instructions(docker / name)
    last_stage = found[max(i for i, (word, _) in enumerate(found) if word == "FROM") :]
    words = [word for word, _ in last_stage]
    users = [value for word, value in last_stage if word == "USER"]
    assert users
    assert users[-1] not in ("root", "0")
    assert words.index("USER") < words.index("CMD")
    for word in ("HEALTHCHECK", "VOLUME", "EXPOSE", "CMD"):
        assert word in words
    assert all(re.search(r":(?!latest)[^ ]+", value) for word, value in found if word == "FROM")


@pytest.mark.parametrize("name", DOCKERFILES)
def test_what_images_copy_is_let_into_their_build(docker: Path, name: str) -> None:
    ignored, *kept = (docker / f"{name}.dockerignore").read_text(encoding="utf-8").split()
    assert ignored == "*"
    allowed = [line[1:] for line in kept if line.startswith("!")]
    for word, value in instructions(docker / name):
        if word == "COPY" and "--from" not in value:
            for source in value.split()[:-1]:
                assert source == "." or any(fnmatch(source, pattern) for pattern in allowed), source
    assert all((docker.parent / pattern).exists() for pattern in allowed)


def test_the_composition_is_closed_in_itself(compose: dict, docker: Path) -> None:
    assert set(compose) == {"name", "services", "volumes", "secrets"}
    for name, service in compose["services"].items():
        assert set(service) <= SERVICE_KEYS, name
        assert set(service["secrets"]) <= set(compose["secrets"])
        assert {volume.split(":")[0] for volume in service["volumes"]} <= set(compose["volumes"])
        assert set(service.get("depends_on", {})) <= set(compose["services"])
        assert "no-new-privileges:true" in service["security_opt"]
        assert "privileged" not in service
    build = compose["services"]["hgs"]["build"]
    assert (docker / build["context"] / build["dockerfile"]).is_file()


def test_the_composition_says_what_the_service_understands_and_holds_no_secret(compose: dict) -> None:
    understood = set(re.findall(r'"(HGS_[A-Z_]+)"', inspect.getsource(settings)))
    told = compose["services"]["hgs"]["environment"]
    for name in told:
        assert name in understood or name.removesuffix("_FILE") in understood or name == "HGS_DATA_DIR", name
    files = {value for name, value in told.items() if name.endswith("_FILE")}
    assert files == {f"/run/secrets/{name}" for name in compose["services"]["hgs"]["secrets"]}
    assert ":" not in told["HGS_DATABASE_URL"].partition("//")[2].partition("@")[0]  # no password in it
    (port,) = compose["services"]["hgs"]["ports"]
    assert port.startswith("127.0.0.1:")
    assert "ports" not in compose["services"]["database"]


def test_the_systemd_unit_is_one(repository: Path, tmp_path: Path) -> None:
    text = (repository / "docs" / "service.md").read_text(encoding="utf-8")
    (unit,) = re.findall(r"```ini\n(.*?)```", text, re.DOTALL)
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze on this machine")
    # What it starts does not lie there; everything else is checked.
    path = tmp_path / "hgs.service"
    path.write_text(re.sub(r"^ExecStart=\S+", "ExecStart=/bin/true", unit, flags=re.MULTILINE))
    answer = subprocess.run(
        ["systemd-analyze", "verify", str(path)], capture_output=True, text=True, check=False
    )
    complaints = [line for line in answer.stderr.splitlines() if "hgs.service" in line]
    assert complaints == []
