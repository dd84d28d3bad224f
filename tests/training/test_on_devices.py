from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
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
from tests.toy_training import SCHEDULE, train
from tests.training.test_ranks import digest, killed_alone, train_here

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


LAUNCHER = "mocoflow_core.training.elastic"


def processes(folder: Path) -> dict[int, list[str]]:
    """All that work on a folder, by number, with their words."""
    found = {}
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (process / "cmdline").read_text().split("\0")
            if str(folder / JOB) in words:
                found[int(process.name)] = words
    return found


def kill_a_rank(folder: Path) -> None:
    ranks = [number for number, words in processes(folder).items() if LAUNCHER not in words]
    os.kill(max(ranks), signal.SIGKILL)


def gone(folder: Path, within_s: float) -> bool:
    """Whether nobody works on a folder any more."""
    end = time.monotonic() + within_s
    while processes(folder) and time.monotonic() < end:
        time.sleep(0.05)
    return not processes(folder)


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
    assert watcher.shares == sorted(set(watcher.shares)) != []
    assert watcher.curves
    assert result.wall_s + watcher.aside[0] == pytest.approx(took_s, abs=0.2)
    assert sorted(p.name for p in (tmp_path / "two").iterdir()) == sorted(
        p.name for p in (tmp_path / "one").iterdir()
    )


LONGER = {"coarse_steps": 100, "checkpoint_every_s": 0.02}


def test_a_killed_rank_starts_again_from_the_last_checkpoint_and_nothing_is_lost(
    job, two_ranks, toy_folder, tmp_path
):
    killed = []

    def kill_once(share: float) -> None:
        if not killed and share > 0.3:
            killed.append(share)
            kill_a_rank(tmp_path / "run")

    watcher = Watcher()
    longer = changed(job, **LONGER)
    result = watcher.optimise(longer, tmp_path / "run", progress=kill_once)
    assert killed
    assert result.tries == 2
    assert result.steps == longer.schedule.joint_steps
    # It did not begin again: what had been reached before is not reported twice.
    assert watcher.shares.count(watcher.shares[0]) == 1
    (_, undisturbed), _ = two_ranks(train_here, toy_folder, tmp_path / "other", longer.schedule)
    assert digest(parameters(tmp_path / "run")) == undisturbed


def test_a_rank_that_dies_again_ends_the_run_in_words_and_overwrites_nothing(job, tmp_path):
    folder = tmp_path / "run"
    shares = []

    def kill_always(share: float) -> None:
        shares.append(share)
        kill_a_rank(folder)

    with pytest.raises(RanksFailed) as ended:
        Watcher().optimise(changed(job, **LONGER), folder, progress=kill_always)
    words = str(ended.value)
    assert "died again" in words
    assert str(folder) in words
    assert "--devices" in words
    assert "SIGKILL" in words
    assert (folder / "checkpoint.safetensors").exists()
    assert not (folder / "model.safetensors").exists()
    assert not (folder / JOB).exists()
    assert gone(folder, within_s=10.0)


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_nobody_is_left_when_the_group_of_the_run_is_told_to_end(job, tmp_path, how):
    """SIGKILL alone reaches only the launching process."""
    file, folder = tmp_path / "given.json", tmp_path / "run"
    file.write_text(changed(job, coarse_steps=10_000).model_dump_json())
    code = (
        "import sys; from pathlib import Path; from tests.training.test_on_devices import *;"
        "Watcher().optimise(read_job(Path(sys.argv[1])), Path(sys.argv[2]),"
        " progress=lambda share: print(share, flush=True))"
    )
    run = subprocess.Popen(
        [sys.executable, "-c", code, str(file), str(folder)],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        process_group=0,
    )
    assert float(run.stdout.readline()) > 0
    assert len(processes(folder)) == 3
    if how == signal.SIGKILL:
        run.kill()
    else:
        os.killpg(run.pid, how)
    assert gone(folder, within_s=30.0)
    assert run.wait(30.0) != 0
    assert not (folder / "model.safetensors").exists()


def test_bad_input_comes_back_as_what_it_is_without_another_try(prepared, job, tmp_path):
    with pytest.raises(InputError, match="rays = 48, got a run with 50"):
        killed_alone(prepared, tmp_path / "run")
        Watcher().optimise(changed(job, rays=50), tmp_path / "run")
    assert (tmp_path / "run" / "checkpoint.safetensors").exists()


def test_a_job_that_is_not_there_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="first machine"):
        read_job(tmp_path / JOB)
