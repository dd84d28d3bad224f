from __future__ import annotations

import os

import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.training.devices import Devices, choose_devices


@pytest.fixture
def machine(monkeypatch):
    """A machine with so many cores and GPUs."""

    def make(cores: int, gpus: int) -> None:
        monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(cores)))
        monkeypatch.setattr("torch.cuda.device_count", lambda: gpus)

    return make


@pytest.mark.parametrize(("cores", "gpus", "chosen"), [(8, 0, 1), (8, 1, 1), (2, 4, 4)])
def test_all_gpus_are_used_and_without_any_one_process(machine, cores, gpus, chosen):
    machine(cores, gpus)
    assert choose_devices() == Devices(here=chosen)


@pytest.mark.parametrize(("cores", "gpus", "asked"), [(4, 0, 4), (2, 3, 3), (2, 3, 1)])
def test_as_many_as_asked_for(machine, cores, gpus, asked):
    machine(cores, gpus)
    assert choose_devices(asked) == Devices(here=asked)


@pytest.mark.parametrize(
    ("cores", "gpus", "asked", "there"),
    [(4, 0, 5, "1 to 4, the cores"), (16, 2, 3, "1 to 2, the GPUs"), (4, 0, 0, "1 to 4")],
)
def test_more_than_there_are_or_none_is_bad_input(machine, cores, gpus, asked, there):
    machine(cores, gpus)
    with pytest.raises(InputError, match=f"{there}.* got {asked}"):
        choose_devices(asked)


def test_several_machines_have_as_many_devices_each(machine):
    machine(4, 0)
    devices = choose_devices(2, machines=3, rendezvous="node0:29400")
    assert devices.in_all == 6


@pytest.mark.parametrize(
    ("machines", "rendezvous"),
    [(2, None), (1, "node0:29400"), (0, None), (2, "node0"), (2, ":29400"), (2, "node0:")],
)
def test_machines_that_cannot_meet_are_bad_input(machines, rendezvous):
    with pytest.raises(InputError, match="--rendezvous"):
        choose_devices(1, machines, rendezvous)
