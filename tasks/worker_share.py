"""The part of a machine that one of several worker processes on it may use."""

from __future__ import annotations

import functools
import os
from collections.abc import Set

from mocoflow_core.threads import share_of
from mocoflow_core.training.devices import visible_gpus


def take_share(index: int, of: int) -> None:
    """Confine this process to its part of the cores and of the GPUs that it could use at first.

    Whatever looks for cores later finds these: torch, OpenCV, video decoders. A GPU that is in use
    already stays in use. Asked again, it takes another part of the same.

    Args:
        index: of this process among the workers of the machine, from 0.
        of: how many workers there are.
    """
    os.sched_setaffinity(0, share_of(_cores(), index, of))
    gpus = _gpus()
    if gpus:
        own = share_of(range(len(gpus)), index, of)
        os.environ["CUDA_VISIBLE_DEVICES"] = ",".join(gpus[position] for position in sorted(own))


def is_confined() -> bool:
    """Whether this process could use only some of the cores already when it began."""
    return len(_cores()) < (os.cpu_count() or 1)


@functools.cache
def _cores() -> Set[int]:
    return frozenset(os.sched_getaffinity(0))


@functools.cache
def _gpus() -> tuple[str, ...]:
    return visible_gpus(os.environ.get("CUDA_VISIBLE_DEVICES"))
