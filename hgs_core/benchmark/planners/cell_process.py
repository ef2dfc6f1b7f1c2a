"""Starts the process of one cell and answers for its end; the same on every engine."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Final

from hgs_core.benchmark.planners.task import CellAnswer, CellTask

_WORKER: Final = "hgs_core.benchmark.planners.worker"
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class CellProcess:
    """A cell at work. It ends with the process that made this object, however that ends."""

    def __init__(self, task: CellTask) -> None:
        self.task = task
        # Threads and kernels are chosen when libraries load: by the environment, before anything is imported.
        environment = {**os.environ, **dict.fromkeys(_THREADS, str(task.threads))}
        self._process = subprocess.Popen(
            [sys.executable, "-m", _WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**environment, "HGS_KERNEL_VARIANT": task.kernel_variant},
            start_new_session=True,  # a terminal's Ctrl-C is for the grid, which ends its cells itself
        )
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(asdict(task)).encode() + b"\n")
        self._process.stdin.flush()

    def ended(self) -> bool:
        return self._process.poll() is not None

    def answer(self) -> CellAnswer:
        """Wait for the end."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with self._process.stdin, self._process.stdout as answers:
            text = answers.read()
            code = self._process.wait()
        if text:
            return CellAnswer(**json.loads(text))
        return CellAnswer(failure=self._without_a_word(code))

    def kill(self) -> None:
        """End it at once; what it wrote so far is a partial folder."""
        self._process.kill()
        self.answer()

    def _without_a_word(self, code: int) -> str:
        if code == -signal.SIGKILL:
            return "its process was killed (SIGKILL), as the system does where memory runs out"
        if code < 0:
            return f"its process was ended by {signal.Signals(-code).name}; see {Path(self.task.log).name}"
        return f"its process ended with exit code {code}; see {Path(self.task.log).name}"
