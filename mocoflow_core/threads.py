"""How many threads torch gets: measured on the work itself, as a busy core makes two slower."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager

import torch

# All cores have to be at least so much faster than one: their threads wait for each other in a
# spin, so a core that gets busy later costs far more than the second one ever brought.
_WORTH_IT = 1.5
_REPEATS = 4


@contextmanager
def torch_threads(threads: int) -> Iterator[None]:
    """Give torch so many threads for a while."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def share_of(cores: Collection[int], index: int, of: int) -> set[int]:
    """The cores, or GPUs, of one of several processes that divide them among themselves.

    Args:
        cores: numbers of those that all of them may use.
        index: of this process, from 0.
        of: how many processes there are; where they are more than the cores, some share one.
    """
    ordered = sorted(cores)
    start, end = index * len(ordered) // of, (index + 1) * len(ordered) // of
    return set(ordered[start : max(end, start + 1)])


def seconds_of(work: Callable[[], None]) -> float:
    """Wall seconds of a piece of work on the present threads; the first one only warms up."""
    work()
    start = time.perf_counter()
    for _ in range(_REPEATS):
        work()
    return (time.perf_counter() - start) / _REPEATS


def choose_threads(forced: int | None, work: Callable[[], None]) -> int:
    """Threads for some work: ``forced``, or whichever of one and all cores does it faster.

    Args:
        forced: as many, but no more than there are cores.
        work: a piece of the work; it is done a few times with either number.
    """
    cores = len(os.sched_getaffinity(0))
    if forced is not None or cores == 1:
        return min(forced or 1, cores)
    seconds = {1: 0.0, cores: 0.0}
    for repeat in range(_REPEATS):
        for threads in seconds:
            with torch_threads(threads):
                start = time.perf_counter()
                work()
            # The first round only warms up; means, not medians: a stall is what counts.
            seconds[threads] += (time.perf_counter() - start) * (repeat > 0)
    return cores if seconds[1] > _WORTH_IT * seconds[cores] else 1
