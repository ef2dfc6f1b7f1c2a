"""The import contracts catch what they are there to catch.

That the repository keeps them is a step of its own in `make test` (`lint-imports`); here they are tried on
copies that break them.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def copy(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources, without what is built from them."""
    root = tmp_path_factory.mktemp("layers")
    shutil.copy(repository / "pyproject.toml", root)
    for package in ("hgs_core", "app"):
        ignored = shutil.ignore_patterns("__pycache__", "*.so", "*.cpp", "*.hpp")
        shutil.copytree(repository / package, root / package, ignore=ignored)
    return root


def violations(root: Path) -> str:
    """What `lint-imports` prints about `root`, or nothing when all contracts are kept."""
    # -S and an explicit path: an editable install would lead back to the checkout.
    program = (
        "import sys; sys.path[:0] = sys.argv.pop(1).split(':');"
        "from importlinter.cli import lint_imports_command; lint_imports_command(['--no-cache', '--no-logo'])"
    )
    answer = subprocess.run(
        [sys.executable, "-S", "-c", program, ":".join([str(root), *site_packages()])],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode in (0, 1), answer.stderr
    assert "Contracts:" in answer.stdout, answer.stdout + answer.stderr
    return "" if answer.returncode == 0 else answer.stdout


def site_packages() -> list[str]:
    return [path for path in sys.path if path.endswith("site-packages")]


@pytest.mark.parametrize(
    ("importer", "statement", "contract"),
    [
        ("geometry/se3.py", "import hgs_core.mapping.snapshot", "downward BROKEN"),
        ("gaussians/gaussian_map.py", "import hgs_core.voxels.voxel_map", "downward BROKEN"),
        ("sensing/frame.py", "import hgs_core.robot.path", "downward BROKEN"),
        ("planning/plan.py", "import hgs_core.simulation", "decision path BROKEN"),
        ("gain/viewpoint.py", "import hgs_core.scene", "decision path BROKEN"),
        ("mapping/snapshot.py", "import hgs_core.evaluation", "decision path BROKEN"),
        ("mission/events.py", "import fastapi", "what serves it BROKEN"),
        ("mission/events.py", "import app", "what serves it BROKEN"),
        ("weather/__init__.py", "", "downward BROKEN"),
    ],
)
def test_a_forbidden_import_is_caught(copy: Path, importer: str, statement: str, contract: str) -> None:
    path = copy / "hgs_core" / importer
    original = path.read_text(encoding="utf-8") if path.exists() else None
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"{original or ''}\n{statement}\n", encoding="utf-8")
    try:
        assert contract in violations(copy)
    finally:
        if original is None:
            shutil.rmtree(path.parent)
        else:
            path.write_text(original, encoding="utf-8")
