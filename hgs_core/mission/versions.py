"""Which software computed a result."""

import platform
from importlib.metadata import version
from typing import Final

_RECORDED: Final = ("hgs", "numpy", "scipy", "torch", "open3d")


def software_versions() -> dict[str, str]:
    """Versions of this project, Python, and the packages that results depend on."""
    return {"python": platform.python_version(), **{name: version(name) for name in _RECORDED}}
