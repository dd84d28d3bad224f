"""Production as `make up` makes it: database, server, deployments, worker."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from flows.production.api import ask, wait_for
from flows.production.postgresql import find_programs
from flows.production.site import Database, Site
from mocoflow_core.errors import InputError
from tests.free_port import free_port

ROOT = Path(__file__).parents[2]
PREFECT = [sys.executable, "-m", "prefect"]
POOL = "mocoflow"
UNNEEDED = "MOCOFLOW_DATABASE_PASSWORD"


@dataclass(frozen=True)
class Production:
    """What a person at the machine has: a command line and the server's API."""

    url: str
    environment: dict[str, str]
    root: Path
    site: Site | None = None

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
        return ask(self.url, path, body)

    def start(self, deployment: str, **parameters: object) -> str:
        """Schedule a run; give its id."""
        found = self.ask(f"/deployments/name/{deployment}")
        made = self.ask(
            f"/deployments/{found['id']}/create_flow_run",
            {
                "parameters": found["parameters"] | parameters,
                "state": {"type": "SCHEDULED"},
                # What a clock has started meanwhile holds nobody up.
                "work_queue_name": "by-hand",
            },
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

    def until(self, true: Callable[[], bool], within_s: float) -> None:
        assert wait_for(true, within_s), f"not within {within_s:g} s"

    def runs(self) -> dict[str, dict]:
        """All runs by name."""
        return {run["name"]: run for run in self.ask("/flow_runs/filter", {"limit": 200})}

    def artifacts(self, run: str) -> dict[str, str]:
        """What a run shows on its pages, by key."""
        wanted = {"flow_runs": {"id": {"any_": [run]}}, "limit": 200}
        return {a["key"]: str(a["data"]) for a in self.ask("/artifacts/filter", wanted)}

    def tasks(self, run: str) -> dict[str, str]:
        """Names of the states in which a run's stages ended."""
        wanted = {"flow_runs": {"id": {"any_": [run]}}, "limit": 200}
        return {t["name"]: t["state_name"] for t in self.ask("/task_runs/filter", wanted)}

    def logs(self, run: str) -> str:
        wanted = {"logs": {"flow_run_id": {"any_": [run]}}, "limit": 200}
        return "\n".join(line["message"] for line in self.ask("/logs/filter", wanted))


@contextmanager
def production(root: Path, files: Path, database: Database) -> Iterator[Production]:
    """Everything that a deployed run needs, for as long as the block lasts.

    Args:
        files: where scenes and results may lie.
    """
    # PostgreSQL does not run as root, and others may not look into what the tests keep.
    state = Path(tempfile.mkdtemp(prefix="mocoflow-e2e-"))
    state.chmod(0o755)
    site = Site(state, free_port(), database)
    environment = site.environment() | {
        "MOCOFLOW_DATA_ROOTS": str(files),
        "MOCOFLOW_RESULTS_ROOT": str(files),
        "PREFECT_SERVER_LOGGING_LEVEL": "WARNING",
        "PREFECT_LOGGING_LEVEL": "INFO",
        "PREFECT_LOGGING_TO_API_ENABLED": "true",
        "PREFECT_WORKER_QUERY_SECONDS": "2",
        "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))),
        "XDG_CACHE_HOME": str(root / "cache"),
        # One of compose's, which nobody here needs.
        UNNEEDED: "a secret",
    }
    del environment["MOCOFLOW_SITE"]
    made = Production(site.api, environment, root, site)
    try:
        print(site_command(made, site, "up", *new(site)))
        yield made
    finally:
        said = site_command(made, site, "down")
        shutil.rmtree(state)
    assert "left behind" not in said


def new(site: Site) -> list[str]:
    """How ``up`` is told what a new site shall have."""
    return ["--port", str(site.port), "--database", str(site.database)]


def site_command(made: Production, site: Site, command: str, *options: str) -> str:
    """What a command of production's own prints."""
    words = [sys.executable, "-m", "flows.production", command, "--state", str(site.folder)]
    words += options
    done = subprocess.run(
        words, cwd=ROOT, env=made.environment, capture_output=True, text=True, timeout=600.0
    )
    logs = "".join(log.read_text()[-3000:] for log in site.logs.glob("*.log"))
    assert done.returncode == 0, done.stdout + done.stderr + logs
    return done.stdout


def available_database() -> Database:
    """PostgreSQL where its programs are, as in production; else a file."""
    try:
        find_programs()
    except InputError:
        return Database.SQLITE
    return Database.POSTGRESQL
