"""Cells on the workers of a Dask cluster, through Prefect's task runner for Dask."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager, nullcontext
from ipaddress import ip_address
from typing import Any

import dask
import distributed
from prefect import task
from prefect.cache_policies import NO_CACHE
from prefect.settings import PREFECT_API_URL
from prefect_dask import DaskTaskRunner
from prefect_dask.task_runners import PrefectDaskFuture

from flows.benchmark_request import Cell
from flows.cell_task import NAME, failed, lost, run_cell_again, seen_from_here
from mocoflow_core.errors import InputError
from mocoflow_core.methods.benchmark_folder import CellRecord
from tasks.inner_runs import cancel_inner_runs, none_left_behind
from tasks.terminal_bar import terminal_line
from tasks.worker_share import is_confined, take_share

_CONNECT_S = 20.0
# So long a cluster may be without any worker that could take a cell: restarts take seconds.
_PATIENCE_S = 60.0
_POLL_S = 0.5
NOBODY = f"no worker was left on the Dask cluster that could take it, for {_PATIENCE_S:g} s"

Running = dict[int, tuple[Cell, PrefectDaskFuture[CellRecord]]]


def run_on_dask(cells: Iterable[Cell], address: str, slots: str | None) -> tuple[CellRecord, ...]:
    """Run cells on a cluster; the records come in the cells' order.

    Dask gives a cell whose worker dies to another one, several times, before it gives it up.

    Args:
        address: of the scheduler.
        slots: a resource of the workers, such as ``GPU``, that each cell takes one of.

    Raises InputError where no scheduler answers or its workers cannot take a cell.
    """
    has_server = PREFECT_API_URL.value() is not None
    ended: dict[int, CellRecord] = {}
    with _cluster(address) as runner, none_left_behind():
        _require_workers(runner.client, slots, has_server)
        running: Running = {}
        with dask.annotate(resources={slots: 1}) if slots else nullcontext():
            for number, cell in enumerate(cells):
                if cell.record.state == "refused":
                    ended[number] = cell.record
                else:
                    running[number] = (cell, runner.submit(cell_on_dask, {"cell": cell}))
        try:
            ended |= _records(running, runner.client, slots)
        except BaseException:
            runner.client.cancel([future.wrapped_future for _, future in running.values()])
            cancel_inner_runs()
            raise
    return tuple(record for _, record in sorted(ended.items()))


@task(name=NAME, task_run_name="{cell.record.name}", cache_policy=NO_CACHE, persist_result=False)
def cell_on_dask(cell: Cell) -> CellRecord:
    """Run one cell in a worker, which leaves the machine's other workers their share."""
    if not is_confined():
        me = distributed.get_worker()
        workers = distributed.get_client().scheduler_info()["workers"]
        here = workers[me.address]["host"]
        beside = sorted(address for address, about in workers.items() if about["host"] == here)
        take_share(beside.index(me.address), len(beside))
    return run_cell_again(cell, None)


@contextmanager
def _cluster(address: str) -> Iterator[DaskTaskRunner]:
    runner = DaskTaskRunner(address=address, client_kwargs={"timeout": _CONNECT_S})
    with runner:
        try:
            _ = runner.client
        except (OSError, ValueError) as error:
            raise InputError(
                "--dask must be the address of a scheduler that answers",
                f"{address} ({error})",
                "dask scheduler --host 127.0.0.1 --port 8786",
            ) from error
        yield runner


def _require_workers(client: distributed.Client, slots: str | None, has_server: bool) -> None:
    workers = client.scheduler_info()["workers"]
    if not _able(workers, slots):
        raise InputError(
            f"A Dask worker {f'with the resource {slots}' if slots else 'at least'} is needed",
            f"{len(workers)} workers",
            f"dask worker ADDRESS --nthreads 1 {f'--resources {slots}=1' if slots else ''}".strip(),
        )
    if any(about["nthreads"] > 1 for about in workers.values()):
        raise InputError(
            "A Dask worker must run one cell at a time",
            "a worker with several threads",
            "Start workers with --nthreads 1, and more of them with --nworkers.",
        )
    if not has_server and not all(_is_loopback(about["host"]) for about in workers.values()):
        raise InputError(
            "Workers on other machines need a Prefect server that they reach",
            "none",
            "Set PREFECT_API_URL, or start scheduler and workers with --host 127.0.0.1.",
        )


def _able(workers: Mapping[str, Mapping[str, Any]], slots: str | None) -> bool:
    """Whether any worker can take a cell."""
    return any(slots is None or slots in about["resources"] for about in workers.values())


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host in ("localhost", "inproc")


def _records(
    running: Running, client: distributed.Client, slots: str | None
) -> Iterator[tuple[int, CellRecord]]:
    """Each cell's record as soon as it is known."""
    left, last_able = dict(running), time.monotonic()
    while left:
        for number, (cell, future) in list(left.items()):
            if future.wrapped_future.done():
                del left[number]
                yield number, _record(cell, future)
        if _able(_workers(client), slots):
            last_able = time.monotonic()
        if time.monotonic() - last_able > _PATIENCE_S:
            yield from ((number, lost(cell, NOBODY)) for number, (cell, _) in left.items())
            return
        time.sleep(_POLL_S)


def _workers(client: distributed.Client) -> Mapping[str, Mapping[str, Any]]:
    """The cluster's workers; none where the scheduler is gone."""
    try:
        return client.scheduler_info()["workers"]
    except (OSError, CancelledError):
        return {}


def _record(cell: Cell, future: PrefectDaskFuture[CellRecord]) -> CellRecord:
    try:
        record = future.result()
    except distributed.KilledWorker:
        record = lost(cell, "its Dask workers died; out of memory, or killed")
    except CancelledError:
        record = lost(cell, "the Dask scheduler has forgotten it")
    except Exception as error:
        record = failed(cell, error)
    terminal_line(f"{cell.record.name} {record.state}")
    return seen_from_here(cell, record)
