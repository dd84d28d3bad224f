"""Cells in several processes of this machine: each has its share of the cores and of the GPUs."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from contextvars import copy_context

from prefect.task_runners import ProcessPoolTaskRunner

from flows.benchmark_request import Cell
from flows.cell_task import cell_in_process, failed, lost
from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.training.launch import die_with_parent
from tasks.inner_runs import cancel_inner_runs, none_left_behind
from tasks.terminal_bar import terminal_line
from tasks.worker_share import take_share

TRIES = 2
DIED = f"its process died {TRIES} times; out of memory, or killed"

Ended = dict[int, CellRecord]


def run_in_processes(
    cells: Iterable[Cell], count: int, slots: str | None
) -> tuple[CellRecord, ...]:
    """Run cells in so many processes at once; the records come in the cells' order.

    A cell whose process dies is tried again in a new one and then given up; the others go on.
    """
    waiting, ended = _Waiting(cells), Ended()
    with none_left_behind(), ThreadPoolExecutor(count) as threads:
        lanes = [_Lane(index, count, slots) for index in range(count)]
        # Prefect's context tells the cells whose they are.
        running = [threads.submit(copy_context().run, lane.work, waiting) for lane in lanes]
        try:
            for lane in running:
                ended |= lane.result()
        except BaseException:
            waiting.stop()
            cancel_inner_runs()
            raise
    return tuple(record for _, record in sorted(ended.items()))


class _Waiting:
    """Cells with their numbers, handed out one by one to whoever is free."""

    def __init__(self, cells: Iterable[Cell]) -> None:
        self._cells = enumerate(cells)
        self._lock = threading.Lock()
        self.stopped = False

    def __iter__(self) -> Iterator[tuple[int, Cell]]:
        while True:
            with self._lock:
                following = None if self.stopped else next(self._cells, None)
            if following is None:
                return
            yield following

    def stop(self) -> None:
        self.stopped = True


class _Lane:
    """One process at a time; a new one where it has died."""

    def __init__(self, index: int, of: int, slots: str | None) -> None:
        self._share = (index, of)
        self._slots = slots

    def work(self, waiting: _Waiting) -> Ended:
        """Run cells until none waits any more."""
        ended = Ended()
        with ExitStack() as self._alive:
            self._begin_process()
            for number, cell in waiting:
                ended[number] = self._run(cell, waiting)
        return ended

    def _begin_process(self) -> None:
        runner = ProcessPoolTaskRunner(1, initializer=_begin, initargs=self._share)
        self._process = self._alive.enter_context(runner)

    def _run(self, cell: Cell, waiting: _Waiting) -> CellRecord:
        if cell.record.state == "refused":
            return cell.record
        for _ in range(TRIES):
            if waiting.stopped:
                break
            terminal_line(cell.record.name)
            given = {"cell": cell, "slots": self._slots}
            try:
                return self._process.submit(cell_in_process, given).result()
            except (BrokenProcessPool, SystemExit, KeyboardInterrupt):
                self._alive.close()
                self._begin_process()
            except Exception as error:
                return failed(cell, error)
        return lost(cell, DIED)


def _begin(index: int, of: int) -> None:
    die_with_parent(signal.SIGTERM)
    take_share(index, of)
