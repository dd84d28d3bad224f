"""Bring a server up to date: work pool, queues, automations, store, deployments, schedules."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any

import yaml
from httpx import HTTPStatusError, TransportError
from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.actions import WorkPoolCreate, WorkPoolUpdate
from prefect.exceptions import ObjectNotFound
from prefect.settings import PREFECT_API_URL

from flows.data_set_roots import ROOTS, configured_roots
from flows.production.automations import make_automation, make_notifications
from flows.production.site import PREFECT
from flows.production.stores import make_store
from mocoflow_core.errors import InputError

FOLDER = Path("deployments")


def deploy() -> list[str]:
    """Make or change what the files say, and give a line on each schedule, and on who is told.

    The schedule of a data set runs where its root is a folder, and is paused where it is not.

    Raises InputError outside of the repository's root, for a store that cannot be made, and where
    no server answers, or wants another password.
    """
    pool = _read("pool.yaml")
    make_store()
    with _let_in(), get_client(sync_client=True) as client:
        _make_pool(client, pool)
        for queue in pool["queues"]:
            _make_queue(client, pool["name"], queue)
        make_automation(client, _read("zombies.yaml"))
        _deploy_flows()
        schedules = [
            line
            for deployment in _read("prefect.yaml")["deployments"]
            for line in _set_schedules(client, deployment)
        ]
        told = make_notifications(client, _read("notifications.yaml")["automations"])
    return [*schedules, told]


@contextmanager
def _let_in() -> Iterator[None]:
    """Raise InputError where no server answers, or where it wants another password."""
    try:
        yield
    except TransportError as error:
        raise InputError(
            f"a server that answers at {PREFECT_API_URL.value()}",
            f"{type(error).__name__}: {error}",
            "make up, or correct PREFECT_API_URL.",
        ) from error
    except HTTPStatusError as error:
        if error.response.status_code != HTTPStatus.UNAUTHORIZED:
            raise
        raise InputError(
            "the password of the server",
            "another one, or none",
            "export PREFECT_API_AUTH_STRING=user:password.",
        ) from error


def _read(name: str) -> dict[str, Any]:
    file = FOLDER / name
    if not file.is_file():
        raise InputError(
            "the repository's root as the working directory",
            f"{Path.cwd()} without {file}",
            "Go there.",
        )
    return yaml.safe_load(file.read_text())


def _make_pool(client: SyncPrefectClient, pool: Mapping[str, Any]) -> None:
    template = pool["base_job_template"]
    try:
        client.read_work_pool(pool["name"])
    except ObjectNotFound:
        asked = WorkPoolCreate(name=pool["name"], type=pool["type"], base_job_template=template)
        client.create_work_pool(asked)
    else:
        client.update_work_pool(pool["name"], WorkPoolUpdate(base_job_template=template))


def _make_queue(client: SyncPrefectClient, pool: str, queue: dict[str, Any]) -> None:
    try:
        found = client.read_work_queue_by_name(queue["name"], work_pool_name=pool)
    except ObjectNotFound:
        client.create_work_queue(**queue, work_pool_name=pool)
    else:
        client.update_work_queue(found.id, **queue)


def _deploy_flows() -> None:
    file = str(FOLDER / "prefect.yaml")
    words = (*PREFECT, "--no-prompt", "deploy", "--all", "--prefect-file", file)
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"prefect deploy failed:\n{done.stdout}{done.stderr}")


def _set_schedules(client: SyncPrefectClient, asked: Mapping[str, Any]) -> Iterator[str]:
    """Keep the schedules of the file alone, a data set's paused without it; say how each is."""
    name = asked["name"]
    missing = _missing_root(name) if name in ROOTS else None
    [deployment] = [
        found
        for found in client.read_deployments()
        if (found.name, found.entrypoint) == (name, asked["entrypoint"])
    ]
    title = f"{client.read_flow(deployment.flow_id).name}/{name}"
    named = {schedule["slug"] for schedule in asked["schedules"]}
    for schedule in deployment.schedules:
        if schedule.slug not in named:  # Of an earlier version, which `prefect deploy` leaves.
            client.delete_deployment_schedule(deployment.id, schedule.id)
        elif name in ROOTS:
            client.update_deployment_schedule(deployment.id, schedule.id, active=not missing)
    for schedule in asked["schedules"]:
        runs = schedule["active"] or name in ROOTS
        state = f"paused: {missing}" if missing else "runs" if runs else "paused"
        yield f"{title:<26} {schedule['cron']} {schedule['timezone']:<9} {state}"


def _missing_root(data_set: str) -> str | None:
    """What has to be done before the schedule of a data set can run, if anything."""
    root = configured_roots().get(data_set)
    if root is None:
        return f"set {ROOTS[data_set]} and deploy again"
    if not root.is_dir():
        return f"{ROOTS[data_set]} is no folder, {root}: mend it and deploy again"
    return None
