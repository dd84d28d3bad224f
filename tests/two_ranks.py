"""Two processes that make up torch's default process group, kept for a whole session of tests."""

from __future__ import annotations

import multiprocessing
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from datetime import timedelta
from pathlib import Path
from typing import Any


def _join(meeting: Path, rank: int) -> None:
    import torch
    import torch.distributed as process_group

    torch.set_num_threads(1)
    process_group.init_process_group(
        "gloo",
        store=process_group.FileStore(str(meeting), 2),
        rank=rank,
        world_size=2,
        timeout=timedelta(seconds=60),
    )


class TwoRanks:
    """Runs a function of a module in both processes at once."""

    def __init__(self) -> None:
        meeting = Path(tempfile.mkdtemp(prefix="mocoflow-ranks-")) / "meeting"
        spawn = multiprocessing.get_context("spawn")
        self._pools = [
            ProcessPoolExecutor(1, spawn, initializer=_join, initargs=(meeting, rank))
            for rank in range(2)
        ]

    def __call__(self, function: Callable[..., Any], *args: object) -> list[Any]:
        """What both give back, by rank; an exception is raised here."""
        waiting = [pool.submit(function, *args) for pool in self._pools]
        # The one that fails first says why; the other one only that nobody answers.
        for ended in as_completed(waiting):
            ended.result()
        return [ended.result() for ended in waiting]

    def close(self) -> None:
        for pool in self._pools:
            pool.shutdown()
