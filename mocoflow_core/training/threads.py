"""How many threads torch gets: decided by a quick probe, because a busy core makes two slower."""

from __future__ import annotations

import os
import time

import torch

# A second thread has to make the probe at least this much faster to be worth its spinning.
_WORTH_IT = 1.15
_ROWS, _WIDTH, _REPEATS = 20_000, 64, 12


def choose_threads(forced: int | None) -> int:
    """Threads for the optimisation: ``forced``, or the faster of one and all free cores."""
    cores = len(os.sched_getaffinity(0))
    if forced is not None:
        return min(forced, cores)
    if cores == 1:
        return 1
    before = torch.get_num_threads()
    try:
        single, all_cores = _probe(1), _probe(cores)
    finally:
        torch.set_num_threads(before)
    return cores if single > _WORTH_IT * all_cores else 1


def _probe(threads: int) -> float:
    """Median seconds of a piece of work shaped like a training step."""
    torch.set_num_threads(threads)
    points, weight = torch.ones(_ROWS, _WIDTH), torch.ones(_WIDTH, _WIDTH)
    seconds = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        torch.relu(points @ weight).sum()
        seconds.append(time.perf_counter() - start)
    return sorted(seconds)[_REPEATS // 2]
