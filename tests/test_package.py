"""The wheel works outside the checkout: presets, the operator page and the kernels travel with it."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import pytest

import hgs_core
from hgs_core.native import kernels

_CHECK = """
from pathlib import Path
import sys

target = Path(sys.argv[1])

import app
import hgs_core
from app.cli import main
from app.settings import static_root
from hgs_core.config.presets import preset_names, presets_root
from hgs_core.mission.config import resolve_mission_config
from hgs_core.native import kernels

for place in (app.__file__, hgs_core.__file__, kernels.__file__, presets_root(), static_root()):
    assert Path(place).is_relative_to(target), place
for name in preset_names("mission"):
    resolve_mission_config(name, {})
print(*sorted(str(path.relative_to(target)) for path in target.rglob("*") if path.is_file()), sep="\\n")
"""


@pytest.fixture(scope="module")
def pyproject(repository: Path) -> dict[str, Any]:
    return tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))


def build_wheel(repository: Path, folder: Path, **settings: str) -> Path:
    options = [f"--config-settings={key.replace('_', '.', 1)}={value}" for key, value in settings.items()]
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", f"--wheel-dir={folder}", *options]
    subprocess.run([*build, f"--config-settings=build-dir={folder / 'build'}", str(repository)], check=True)
    (wheel,) = folder.glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", f"--target={folder / 'installed'}", str(wheel)], check=True)
    return folder / "installed"


def files_seen_from_elsewhere(installed: Path, cwd: Path) -> set[str]:
    """Run the check in a process that knows only `installed` and the libraries; returns the files there."""
    # -S: without the .pth file through which an editable install would lead back to the checkout.
    libraries = [path for path in sys.path if path.endswith("site-packages")]
    program = f"import sys; sys.path[:0] = {[str(installed), *libraries]!r}\n{_CHECK}"
    answer = subprocess.run(
        [sys.executable, "-S", "-c", program, str(installed)],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 0, answer.stderr
    return set(answer.stdout.split("\n"))


def tracked_assets(repository: Path) -> set[str]:
    """Where every preset, every file of the page and every migration must lie in the wheel."""
    assets = set()
    migrations = "app/storage/migrations/versions"
    for source, place in (
        ("configs", "hgs_core/configs"),
        ("frontend_static", "app/frontend_static"),
        (migrations, migrations),
    ):
        files = (p for p in (repository / source).rglob("*") if p.is_file() and p.suffix != ".pyc")
        assets |= {f"{place}/{path.relative_to(repository / source)}" for path in files}
    return assets


def test_an_installed_wheel_needs_no_checkout(repository: Path, tmp_path: Path) -> None:
    """Without compiling: the kernels of this environment are put where the build would put them."""
    installed = build_wheel(repository, tmp_path, wheel_cmake="false")
    shutil.copy(kernels.__file__, installed / "hgs_core" / "native")
    files = files_seen_from_elsewhere(installed, tmp_path)
    assert tracked_assets(repository) <= files
    assert not [name for name in files if name.endswith((".cpp", ".hpp", "CMakeLists.txt"))]


@pytest.mark.slow
def test_a_compiled_wheel_needs_no_checkout(repository: Path, tmp_path: Path) -> None:
    files = files_seen_from_elsewhere(build_wheel(repository, tmp_path), tmp_path)
    assert tracked_assets(repository) <= files
    assert any(re.fullmatch(r"hgs_core/native/kernels\..*\.so", name) for name in files)


def test_the_version_is_one(pyproject: dict[str, Any]) -> None:
    assert pyproject["project"]["version"] == hgs_core.__version__


def test_torch_is_pinned_exactly(pyproject: dict[str, Any]) -> None:
    assert "torch==2.13.0" in pyproject["project"]["dependencies"]


def test_every_imported_library_is_declared(repository: Path, pyproject: dict[str, Any]) -> None:
    declared = {
        _normalised(re.split(r"[\[<>=!~; ]", requirement, maxsplit=1)[0])
        for requirement in pyproject["project"]["dependencies"]
    }
    declared.add("starlette")  # FastAPI's own interface consists of its classes
    # Extras need not be installed here: they are told by their own name.
    extras = {
        _normalised(re.split(r"[\[<>=!~; ]", requirement, maxsplit=1)[0])
        for name, requirements in pyproject["project"]["optional-dependencies"].items()
        if name != "dev"
        for requirement in requirements
    }
    distributions = packages_distributions()
    undeclared = {
        f"{path.relative_to(repository)}: {name}"
        for package in ("app", "hgs_core")
        for path in (repository / package).rglob("*.py")
        for name in imported_packages(path)
        if name not in sys.stdlib_module_names
        and name not in ("app", "hgs_core")
        and not declared & {_normalised(found) for found in distributions.get(name, [])}
        and _normalised(name) not in extras
    }
    assert not undeclared


def imported_packages(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.split(".")[0]


def _normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
