"""A pytest plugin: the tests run on the kernels of the file `HGS_SANITIZED_KERNELS` (see `make sanitize`).

The run fails when it leaves out any function of the module: a new kernel is not to go unchecked because its
tests are not among those that run.
"""

import functools
import importlib.util
import inspect
import os
import sys

import pytest

import hgs_core.native

_spec = importlib.util.spec_from_file_location("hgs_core.native.kernels", os.environ["HGS_SANITIZED_KERNELS"])
assert _spec is not None
assert _spec.loader is not None
_kernels = importlib.util.module_from_spec(_spec)
sys.modules["hgs_core.native.kernels"] = _kernels
_spec.loader.exec_module(_kernels)
hgs_core.native.kernels = _kernels  # type: ignore[attr-defined]

_functions = {
    name: value
    for name, value in vars(_kernels).items()
    if callable(value) and not inspect.isclass(value) and not name.startswith("_")
}
_not_called = set(_functions)


def _noted(name, kernel):
    @functools.wraps(kernel)
    def call(*args, **kwargs):
        _not_called.discard(name)
        return kernel(*args, **kwargs)

    return call


for _name, _kernel in _functions.items():
    setattr(_kernels, _name, _noted(_name, _kernel))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for name in sorted(_not_called):
        terminalreporter.write_line(f"no test called the kernel {name}", red=True)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    if _not_called and exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
