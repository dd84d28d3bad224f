"""A Dask scheduler and workers with one abstract GPU each, as separate processes on loopback."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DASK = [sys.executable, "-m", "dask"]


@dataclass(frozen=True)
class Cluster:
    """The scheduler's address, and the processes with what they have written."""

    address: str
    folder: Path
    processes: dict[str, subprocess.Popen]

    def log(self, name: str) -> str:
        return (self.folder / f"{name}.log").read_text()

    def kill(self, name: str) -> None:
        """As the kernel does when memory is short: no word, nothing written."""
        self.processes[name].send_signal(signal.SIGKILL)
        self.processes[name].wait()


@contextmanager
def cluster(folder: Path, environment: dict[str, str], workers: int = 2) -> Iterator[Cluster]:
    """For as long as the block lasts; the workers are called w0, w1, ..."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    made = Cluster(f"tcp://127.0.0.1:{port}", folder, {})
    here = ["--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0"]
    try:
        _start(made, environment, "scheduler", "scheduler", *here, "--port", str(port))
        for number in range(workers):
            own = ["--name", f"w{number}", "--local-directory", str(folder)]
            takes = ["--nthreads", "1", "--no-nanny", "--resources", "GPU=1"]
            _start(made, environment, f"w{number}", "worker", made.address, *here, *own, *takes)
        for number in range(workers):
            _wait_for(made, f"w{number}", "Registered to")
        yield made
    finally:
        for process in made.processes.values():
            with suppress(ProcessLookupError):
                process.kill()
            process.wait()


def _start(made: Cluster, environment: dict[str, str], name: str, *words: str) -> None:
    with (made.folder / f"{name}.log").open("wb") as log:
        made.processes[name] = subprocess.Popen(
            [*DASK, *words], cwd=ROOT, env={**os.environ, **environment}, stdout=log, stderr=log
        )


def _wait_for(made: Cluster, name: str, text: str, within_s: float = 90.0) -> None:
    end = time.monotonic() + within_s
    while not re.search(text, made.log(name)):
        assert made.processes[name].poll() is None, made.log(name)
        assert time.monotonic() < end, made.log(name)
        time.sleep(0.2)
