"""What every test shares: run-time type checks, thread counts, hypothesis profiles, third-party material.

Set-up runs at import, before any test module imports torch or `hgs_core`: thread counts are read when the
libraries load, and the type-checking hook only sees modules that are imported after it.
"""

import os
from pathlib import Path

# One thread a library: tests then give the same sums on every machine, and never crowd out each other.
# Environment variables, so that processes that a test spawns follow the same policy.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

# Consoles take their width when they are made; a worker of a parallel run would fix it for all tests.
os.environ.pop("COLUMNS", None)

# Shapes and dtypes of annotated functions and dataclasses are checked in this process; child processes that
# a test spawns import the package plainly, as in production.
from jaxtyping import install_import_hook

import tests.runtime_types

install_import_hook("hgs_core", f"{tests.runtime_types.__name__}.checked")

import hypothesis
import pytest
import torch

torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))

# No deadlines: a busy machine is not a failure. In CI the examples are the same in every run.
hypothesis.settings.register_profile("default", deadline=None)
hypothesis.settings.register_profile("ci", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "default")

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def repository() -> Path:
    """The checkout that the tests run in."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """Third-party scenes and recordings: where `HGS_SHARED` points, or `shared/` beside the checkout."""
    named = os.environ.get("HGS_SHARED")
    directory = Path(named) if named else REPOSITORY.parent / "shared"
    if not (directory / "scenes").is_dir():
        pytest.skip(f"no third-party test material in {directory}; HGS_SHARED may name its folder")
    return directory
