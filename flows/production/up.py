"""Everything that deployed runs need on one machine, and its end."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.error import HTTPError

from flows.production.api import admits, answers, ask, wait_for
from flows.production.deploy_site import deploy_site, require_the_same_worker
from flows.production.postgresql import PostgreSQL
from flows.production.processes import end_what_is_left, is_running, start, stop
from flows.production.site import AUTHENTICATION, PREFECT, Database, Site
from mocoflow_core.errors import InputError

POOL = "mocoflow"
RUNS_AT_ONCE = 2
# A first start on a busy machine.
STARTS_WITHIN_S = 300.0
UNDER_WAY = ("RUNNING", "PENDING", "CANCELLING")


def bring_up(site: Site) -> Iterator[str]:
    """Start what is not running yet, deploy, and say what was done.

    Raises InputError for a port that is taken, and for another database, password or other folders
    than what is running has; RuntimeError where something does not start.
    """
    _require_the_same(site)
    require_the_same_worker(site)
    site.folder.mkdir(parents=True, exist_ok=True)
    site.logs.mkdir(exist_ok=True)
    url = PostgreSQL(site).start() if site.database == Database.POSTGRESQL else None
    site.save()
    if url:
        yield "PostgreSQL   runs"
    if not is_running(site, "server"):
        _start_server(site, url)
    _require(wait_for(lambda: answers(site.api), STARTS_WITHIN_S), site, "server")
    _require_the_same_password(site)
    yield f"server       {site.api}"
    deploy_site(site)
    _pause(site, False)
    if not is_running(site, "worker"):
        words = ["worker", "start", "--pool", POOL, "--name", _worker()]
        limit = ["--limit", str(RUNS_AT_ONCE)]
        start(site, "worker", [*PREFECT, *words, *limit], site.environment())
    _require(wait_for(lambda: _is_online(site), STARTS_WITHIN_S), site, "worker")
    roots = site.environment()
    yield f"worker       {_worker()}, {RUNS_AT_ONCE} runs at once"
    yield f"scenes       below {roots['MOCOFLOW_DATA_ROOTS']}"
    yield f"results      {roots['MOCOFLOW_RESULTS_ROOT']}"
    yield f"logs         {site.logs}"
    yield f"pages        {site.pages}"
    yield f"prefect      export PREFECT_API_URL={site.api} PATH={Path(sys.executable).parent}:$PATH"


def take_down(site: Site, grace_s: float = 60.0) -> Iterator[str]:
    """Cancel what runs, end all processes, and say what was done.

    What waits in a queue stays there: the pool is paused until the site is brought up again.
    """
    if is_running(site, "worker"):
        try:
            yield from _cancel_runs(site, grace_s)
        except OSError as error:
            yield f"runs are ended without being cancelled: {error}{_hint(error)}"
    for name in ("worker", "server"):
        if stop(site, name):
            yield f"{name} stopped"
    if site.database == Database.POSTGRESQL and PostgreSQL(site).stop():
        yield "PostgreSQL stopped"
    if left := end_what_is_left(site):
        yield f"{len(left)} processes that were left behind ended"


def _start_server(site: Site, url: str | None) -> None:
    with socket.socket() as asked:
        if asked.connect_ex(("127.0.0.1", site.port)) == 0:
            raise InputError(
                "a free port for the server", str(site.port), "Choose another: make up PORT=4201."
            )
    words = ["server", "start", "--host", "127.0.0.1", "--port", str(site.port)]
    start(site, "server", [*PREFECT, *words], site.environment(url))


def _cancel_runs(site: Site, grace_s: float) -> Iterator[str]:
    """As the button on a run's page; their finished stages stay in the store."""
    _pause(site, True)
    asked: dict[str, str] = {}

    def are_gone() -> bool:
        # Again and again, as the worker may have taken one just before the pause.
        under_way = _runs(site)
        for run in under_way:
            if run["id"] not in asked:
                wanted = {"state": {"type": "CANCELLING", "name": "Cancelling"}}
                ask(site.api, f"/flow_runs/{run['id']}/set_state", wanted)
                asked[run["id"]] = run["name"]
        return not under_way

    in_time = wait_for(are_gone, grace_s)
    if asked:
        yield f"{len(asked)} runs cancelled: {', '.join(asked.values())}"
    if not in_time:
        yield f"some did not end within {grace_s:g} s and are killed"


def _hint(error: OSError) -> str:
    refused = isinstance(error, HTTPError) and error.code == HTTPStatus.UNAUTHORIZED
    return f"; set {AUTHENTICATION} as it was for make up" if refused else ""


def _pause(site: Site, paused: bool) -> None:
    """Let the worker take no more runs, or take them again."""
    ask(site.api, f"/work_pools/{POOL}", {"is_paused": paused}, "PATCH")


def _runs(site: Site) -> list[dict[str, Any]]:
    wanted = {"flow_runs": {"state": {"type": {"any_": UNDER_WAY}}}}
    return [
        run for run in ask(site.api, "/flow_runs/filter", wanted) if not run["parent_task_run_id"]
    ]


def _is_online(site: Site) -> bool:
    workers = ask(site.api, f"/work_pools/{POOL}/workers/filter", {})
    return any(w["name"] == _worker() and w["status"] == "ONLINE" for w in workers)


def _worker() -> str:
    return socket.gethostname()


def _require(succeeded: bool, site: Site, name: str) -> None:
    if not succeeded:
        raise RuntimeError(f"the {name} did not start; {site.logs}/{name}.log says why")


def _require_the_same(site: Site) -> None:
    before = Site.of_folder(site.folder)
    if before and before != site and is_running(before, "server"):
        raise InputError(
            f"the site in {site.folder}, which runs with {before.database} on {before.port}",
            f"{site.database} on {site.port}",
            "Take it down first: make down.",
        )


def _require_the_same_password(site: Site) -> None:
    secret = os.environ.get(AUTHENTICATION)
    is_open = admits(site.api, None)
    if is_open != (not secret) or not admits(site.api, secret):
        raise InputError(
            f"the {'empty ' if is_open else ''}{AUTHENTICATION} that the running server has",
            "another one" if secret else "none",
            "Set the same, or take it down first: make down.",
        )
