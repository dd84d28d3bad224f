from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file

from mocoflow_core.errors import InputError
from mocoflow_core.losses.weights import LossConfig
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.devices import Devices
from mocoflow_core.training.job import ShellJob, read_job
from mocoflow_core.training.on_devices import JOB, RanksFailed, optimise_on
from mocoflow_core.training.problem import Learned
from tests.toy_training import SCHEDULE, silent, train

LOSSES = LossConfig(consensus_points=40)
TWO = Devices(here=2)


@pytest.fixture(scope="module")
def job(prepared, tmp_path_factory):
    """The toy optimisation as another process gets it."""
    root = tmp_path_factory.mktemp("stages")
    folders = {name: root / name for name in ("clip", "density", "motion")}
    for name, folder in folders.items():
        folder.mkdir()
        getattr(prepared, name).save(folder)
    return ShellJob(
        **folders,
        shape=prepared.shape,
        learned=Learned(),
        losses=LOSSES,
        schedule=SCHEDULE,
        seed=0,
        before=Seconds(),
    )


def changed(job: ShellJob, **fields) -> ShellJob:
    return job.model_copy(update={"schedule": job.schedule.model_copy(update=fields)})


class Watcher:
    """What a launching process sees and hears."""

    def __init__(self) -> None:
        self.shares: list[float] = []
        self.curves: list[int] = []
        self.lines: list[str] = []
        self.aside = [0.0, 0.0]

    def optimise(self, job: ShellJob, folder: Path, devices: Devices = TWO, progress=None):
        def seen(share: float, text: str) -> None:
            self.shares.append(share)
            if progress:
                progress(share)

        return optimise_on(
            devices,
            job,
            folder,
            seen,
            lambda curve: self.curves.append(len(curve)),
            self.leave_out,
            self.lines.append,
        )

    def leave_out(self, wall_s: float, cpu_s: float) -> None:
        self.aside[0] += wall_s
        self.aside[1] += cpu_s


def parameters(folder: Path) -> dict[str, torch.Tensor]:
    return load_file(folder / "model.safetensors")


def workers(folder: Path) -> list[int]:
    """Process numbers of everything that works on a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if str(folder / JOB).encode() in words:
            found.append(int(process.name))
    return found


def ranks_alone(folder: Path) -> list[int]:
    return [n for n in workers(folder) if b"-P" not in Path(f"/proc/{n}/cmdline").read_bytes()]


def test_one_device_takes_no_other_process_and_ends_as_ever(prepared, job, tmp_path):
    watcher = Watcher()
    watcher.optimise(job, tmp_path / "job", Devices())
    train(prepared, tmp_path / "train", losses=LOSSES)
    ours, theirs = parameters(tmp_path / "job"), parameters(tmp_path / "train")
    assert all(torch.equal(ours[name], value) for name, value in theirs.items())
    assert watcher.lines == []


def test_two_processes_end_where_one_ends(prepared, job, tmp_path):
    watcher = Watcher()
    start = time.perf_counter()
    result = watcher.optimise(job, tmp_path / "two")
    took_s = time.perf_counter() - start
    alone = train(prepared, tmp_path / "one", losses=LOSSES)
    assert result.steps == alone.steps
    assert result.losses == pytest.approx(alone.losses, rel=1e-3)
    ours, theirs = parameters(tmp_path / "two"), parameters(tmp_path / "one")
    for name, value in theirs.items():
        assert torch.allclose(ours[name], value, atol=1e-4), name
    # It was seen from outside, and what starting took is no training.
    assert watcher.shares == sorted(watcher.shares) != []
    assert watcher.curves
    assert result.wall_s + watcher.aside[0] == pytest.approx(took_s, abs=0.2)
    assert sorted(p.name for p in (tmp_path / "two").iterdir()) == sorted(
        p.name for p in (tmp_path / "one").iterdir()
    )
