"""A Prefect server, a work pool with all deployments and a worker, as separate processes."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.error import URLError
from urllib.request import Request, urlopen

ROOT = Path(__file__).parents[2]
PREFECT = [sys.executable, "-m", "prefect"]
POOL = "mocoflow"


@dataclass(frozen=True)
class Production:
    """What a person at the machine has: a command line and the server's API."""

    url: str
    environment: dict[str, str]
    root: Path

    def prefect(self, *words: str, wait_s: float = 120.0) -> str:
        """Run a command of Prefect's from the repository's root; give what it prints."""
        done = subprocess.run(
            [*PREFECT, *words],
            cwd=ROOT,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=wait_s,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def ask(self, path: str, body: dict | None = None):
        """One question to the API."""
        content = None if body is None else json.dumps(body).encode()
        question = Request(self.url + path, content, {"Content-Type": "application/json"})
        with urlopen(question, timeout=30.0) as answer:
            return json.loads(answer.read())

    def start(self, deployment: str, **parameters: object) -> str:
        """Schedule a run; give its id."""
        found = self.ask(f"/deployments/name/{deployment}")
        made = self.ask(
            f"/deployments/{found['id']}/create_flow_run",
            {"parameters": found["parameters"] | parameters, "state": {"type": "SCHEDULED"}},
        )
        return made["id"]

    def state(self, run: str) -> str:
        return self.ask(f"/flow_runs/{run}")["state"]["type"]

    def cancel(self, run: str) -> None:
        """What the button on the run's page does."""
        wanted = {"state": {"type": "CANCELLING", "name": "Cancelling"}}
        self.ask(f"/flow_runs/{run}/set_state", wanted)

    def wait(self, run: str, *states: str, within_s: float) -> str:
        """Until a run is in one of the states; give the one."""
        end = time.monotonic() + within_s
        while (now := self.state(run)) not in states:
            assert time.monotonic() < end, f"{run} is {now}, not {states}, after {within_s:g} s"
            time.sleep(0.5)
        return now

    def runs(self) -> dict[str, dict]:
        """All runs by name."""
        return {run["name"]: run for run in self.ask("/flow_runs/filter", {"limit": 200})}

    def artifacts(self, run: str) -> dict[str, str]:
        """What a run shows on its pages, by key."""
        wanted = {"flow_runs": {"id": {"any_": [run]}}, "limit": 200}
        return {a["key"]: a["data"] for a in self.ask("/artifacts/filter", wanted)}

    def logs(self, run: str) -> str:
        wanted = {"logs": {"flow_run_id": {"any_": [run]}}, "limit": 200}
        return "\n".join(line["message"] for line in self.ask("/logs/filter", wanted))


@contextmanager
def production(root: Path) -> Iterator[Production]:
    """Everything that a deployed run needs, for as long as the block lasts."""
    port = _free_port()
    url = f"http://127.0.0.1:{port}/api"
    environment = {
        **os.environ,
        "PREFECT_HOME": str(root / "prefect"),
        "PREFECT_API_URL": url,
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
        "PREFECT_LOGGING_LEVEL": "INFO",
        "PREFECT_LOGGING_TO_API_ENABLED": "true",
        "PREFECT_FLOWS_HEARTBEAT_FREQUENCY": "30",
        "PREFECT_WORKER_QUERY_SECONDS": "2",
        "XDG_CACHE_HOME": str(root / "cache"),
        "DO_NOT_TRACK": "1",
        "NO_COLOR": "1",
    }
    made = Production(url, environment, root)
    with _running(made, "server", "start", "--host", "127.0.0.1", "--port", str(port)):
        _wait_for(url + "/health")
        made.prefect("work-pool", "create", POOL, "--type", "process")
        made.prefect("--no-prompt", "deploy", "--all", "--prefect-file", "deployments/prefect.yaml")
        with _running(made, "worker", "start", "--pool", POOL, "--name", "here"):
            yield made


@contextmanager
def _running(made: Production, *words: str) -> Iterator[None]:
    # In a group of its own, so that nothing that it has started outlives it.
    with (made.root / f"{words[0]}.log").open("wb") as log:
        process = subprocess.Popen(
            [*PREFECT, *words],
            cwd=made.root,
            env=made.environment,
            stdout=log,
            stderr=log,
            process_group=0,
        )
        try:
            yield
        finally:
            _end(process)


def _end(process: subprocess.Popen) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _wait_for(url: str, within_s: float = 120.0) -> None:
    end = time.monotonic() + within_s
    while True:
        with suppress(URLError, ConnectionError), urlopen(url, timeout=5.0):
            return
        assert time.monotonic() < end, f"nothing answers at {url}"
        time.sleep(0.5)


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])
