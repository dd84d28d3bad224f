"""A Prefect server and a worker that can be killed and started again, each alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.request import urlopen

import yaml

from flows.production.site import LEASES, LEASES_IN_FILES
from tests.e2e.production import POOL, ROOT, Production
from tests.free_port import free_port

DEPLOYMENTS = "deployments/prefect.yaml"
ENDED = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")


class PatientProduction(Production):
    """Asks again where the server is away or its database busy."""

    def ask(self, path: str, body: dict | None = None, within_s: float = 120.0):
        end = time.monotonic() + within_s
        while True:
            try:
                return super().ask(path, body)
            except (URLError, ConnectionError, TimeoutError) as error:
                busy = not isinstance(error, HTTPError) or error.code == 503
                if not busy or time.monotonic() > end:
                    raise
                time.sleep(1.0)


class Service:
    """A long-lived process with all that it starts."""

    def __init__(self, words: list[str], folder: Path, environment: Mapping[str, str]) -> None:
        self._words, self._folder, self._environment = words, folder, environment
        self._process: subprocess.Popen | None = None

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    def start(self) -> None:
        with (self._folder / f"{'-'.join(self._words[:2])}.log").open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "prefect", *self._words],
                cwd=self._folder,
                env=dict(self._environment),
                stdout=log,
                stderr=log,
                process_group=0,
            )

    def kill(self) -> None:
        """Nothing of it is told, as when the machine loses power."""
        if self._process is not None:
            for pid in (self.pid, *descendants(self.pid)):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            self._process.wait()

    def kill_alone(self) -> None:
        """What it has started goes on."""
        os.kill(self.pid, signal.SIGKILL)
        assert self._process is not None
        self._process.wait()


@dataclass(frozen=True)
class Services:
    made: Production
    server: Service
    worker: Service

    def start_server(self) -> None:
        self.server.start()
        until(lambda: answers(self.made.url + "/health"), 300.0, "the server answers")


@contextmanager
def services(
    root: Path, database: str | None = None, silent_s: int | None = None
) -> Iterator[Services]:
    """A server with the deployments, and a worker, for as long as the block lasts.

    Args:
        database: address of the server's database, by default a file below ``root``.
        silent_s: so long without a heartbeat, a run is Crashed; by default as long as deployed.
    """
    port = free_port()
    environment = {
        **os.environ,
        "PREFECT_HOME": str(root / "prefect"),
        "PREFECT_API_URL": f"http://127.0.0.1:{port}/api",
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
        "PREFECT_LOGGING_LEVEL": "INFO",
        "PREFECT_LOGGING_TO_API_ENABLED": "true",
        "PREFECT_FLOWS_HEARTBEAT_FREQUENCY": "30",
        "PREFECT_WORKER_QUERY_SECONDS": "2",
        LEASES: LEASES_IN_FILES,
        "XDG_CACHE_HOME": str(root / "cache"),
        "PYTHONPATH": str(ROOT),
        "DO_NOT_TRACK": "1",
        "NO_COLOR": "1",
    }
    if database:
        environment["PREFECT_SERVER_DATABASE_CONNECTION_URL"] = database
    server = ["server", "start", "--host", "127.0.0.1", "--port", str(port)]
    worker = ["worker", "start", "--pool", POOL, "--name", "here"]
    made = PatientProduction(environment["PREFECT_API_URL"], environment, root)
    together = Services(
        made, Service(server, root, environment), Service(worker, root, environment)
    )
    try:
        together.start_server()
        patiently = partial(made.prefect, wait_s=400.0)
        patiently("work-pool", "create", POOL, "--type", "process")
        patiently("--no-prompt", "deploy", "-n", "full", "--prefect-file", DEPLOYMENTS)
        _end_silent_runs(made, silent_s)
        together.worker.start()
        yield together
    finally:
        together.worker.kill()
        together.server.kill()


def _end_silent_runs(made: Production, silent_s: int | None) -> None:
    """The automation that is deployed; it may be quicker than on a site."""
    content = yaml.safe_load((ROOT / "deployments" / "zombies.yaml").read_text())
    if silent_s:
        content["trigger"]["within"] = silent_s
    made.ask("/automations/", content)


def until(true: Callable[[], object], within_s: float, what: str, every_s: float = 0.2) -> None:
    """Wait until something is so."""
    end = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end, f"not within {within_s:g} s: {what}"
        time.sleep(every_s)


def answers(url: str) -> bool:
    with suppress(URLError, ConnectionError, TimeoutError), urlopen(url, timeout=5.0):
        return True
    return False


def descendants(pid: int) -> list[int]:
    """Processes that a process has started, and those that they have, whatever their session."""
    parents = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = status.read_text().rpartition(")")[2].split()
            parents[int(status.parent.name)] = int(fields[1])
    found = [pid]
    for known in found:
        found += [child for child, parent in parents.items() if parent == known]
    return found[1:]
