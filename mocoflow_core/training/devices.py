"""On how many devices an optimisation runs."""

from __future__ import annotations

import os
from dataclasses import dataclass

import torch

from mocoflow_core.errors import InputError


@dataclass(frozen=True)
class Devices:
    """One process for each device: GPUs where there are any, else cores."""

    here: int = 1  # on this machine, and on each other one
    machines: int = 1
    rendezvous: str = ""  # host:port at which several machines meet

    @property
    def in_all(self) -> int:
        return self.here * self.machines


def choose_devices(
    asked: int | None = None, machines: int = 1, rendezvous: str | None = None
) -> Devices:
    """All GPUs that are visible, or one process on a machine without; or as many as asked for.

    More processes than cores are refused as well as more than GPUs: each would wait for the others
    at every step, for longer than one alone takes.

    Raises InputError for more devices than there are, and for machines that cannot meet.
    """
    gpus = torch.cuda.device_count()
    there_are = gpus or len(os.sched_getaffinity(0))
    if asked is not None and not 1 <= asked <= there_are:
        raise InputError(
            f"--devices must be 1 to {there_are}, the {'GPUs' if gpus else 'cores'} that this "
            "process may use",
            str(asked),
            "Ask for fewer, or leave --devices out.",
        )
    if machines < 1 or (machines > 1) != bool(rendezvous):
        raise InputError(
            "Several --machines need a --rendezvous, and one needs none",
            f"--machines {machines} --rendezvous {rendezvous}",
            "Write --machines 2 --rendezvous HOST:29400 with the first machine's name.",
        )
    host, _, port = (rendezvous or ":1").rpartition(":")
    if rendezvous and (not host or not port.isdigit()):
        raise InputError(
            "--rendezvous must be HOST:PORT", repr(rendezvous), "Write the first machine's name."
        )
    return Devices(asked or max(gpus, 1), machines, rendezvous or "")


def visible_gpus(named: str | None) -> tuple[str, ...]:
    """The GPUs that this process may use, as ``CUDA_VISIBLE_DEVICES`` calls them.

    Args:
        named: that variable, where it is set.
    """
    count = torch.cuda.device_count()
    names = named.split(",") if named else map(str, range(count))
    return tuple(name.strip() for name in names)[:count]
