"""The number of devices is refused before any work, and decides nothing about the result."""

from __future__ import annotations

import os

import pytest

from flows.request import Request
from mocoflow_core.errors import InputError
from mocoflow_core.training.devices import Devices
from mocoflow_core.training.on_devices import optimise_on

CORES = len(os.sched_getaffinity(0))


@pytest.mark.parametrize(
    "options",
    [{"devices": CORES + 1}, {"devices": 0}, {"machines": 2}, {"rendezvous": "node0:29400"}],
)
def test_devices_that_are_not_there_are_bad_input_before_any_work(toy_scene, tmp_path, options):
    out = tmp_path / "out"
    with pytest.raises(InputError, match=r"--devices|--rendezvous"):
        Request(scene_path=toy_scene, store_url=str(tmp_path / "store"), **options).claim(out)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_gone_on_with_on_any_number_of_devices(toy_scene, tmp_path):
    for devices in (None, 1, CORES):
        Request(scene_path=toy_scene, devices=devices).claim(tmp_path / "out")


@pytest.mark.skipif(CORES < 2, reason="needs two cores")
def test_a_scene_of_two_devices_is_found_again_with_one(
    reconstruct, toy_scene, first_run, tmp_path, monkeypatch
):
    """How two processes work together has tests of its own: here one does it for both."""
    asked = []

    def alone(devices, *others):
        asked.append(devices.here)
        return optimise_on(Devices(1), *others)

    monkeypatch.setattr("tasks.optimise_scene.optimise_on", alone)
    # Everything but the optimisation is in the store already.
    settings = ("schedule.fine_steps=9",)
    two = reconstruct(toy_scene, tmp_path / "two", settings=settings, devices=2)
    one = reconstruct(toy_scene, tmp_path / "one", settings=settings, devices=1)
    assert asked == [two.machine["devices"]] == [2]
    assert two.stage("optimise_scene").cached is False
    assert one.stage("optimise_scene").cached is True
    assert one.scores == two.scores
