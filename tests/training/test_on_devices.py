from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.devices import Devices
from mocoflow_core.training.job import ShellJob, read_job
from mocoflow_core.training.on_devices import JOB, RanksFailed, optimise_on
from mocoflow_core.training.problem import Learned
from tests.joint_training import digest, killed_alone, parameters, train_here
from tests.toy_training import LOSSES, SCHEDULE

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


def test_one_device_takes_no_other_process_and_ends_as_ever(job, alone, tmp_path):
    watcher = Watcher()
    watcher.optimise(job, tmp_path / "run", Devices())
    assert digest(parameters(tmp_path / "run")) == digest(parameters(alone[0]))
    assert watcher.lines == []


@pytest.mark.e2e
def test_a_killed_rank_starts_again_from_the_last_checkpoint_and_nothing_is_lost(
    job, alone, two_ranks, toy_folder, tmp_path
):
    killed = []

    def kill_once(share: float) -> None:
        if not killed:
            killed.append(share)
            kill_a_rank(tmp_path / "run")

    watcher, careful = Watcher(), changed(job, fine_steps=25, checkpoint_every_s=0.02)
    start = time.perf_counter()
    result = watcher.optimise(careful, tmp_path / "run", progress=kill_once)
    took_s = time.perf_counter() - start
    assert killed
    assert result.tries == 2
    assert result.steps == careful.schedule.joint_steps
    (_, undisturbed), _ = two_ranks(train_here, toy_folder, tmp_path / "other", careful.schedule)
    assert digest(parameters(tmp_path / "run")) == undisturbed
    # It was seen from outside: it did not begin again, and to start processes is no training.
    assert watcher.shares == sorted(set(watcher.shares))
    assert watcher.curves
    assert result.wall_s + watcher.aside[0] == pytest.approx(took_s, abs=0.2)
    assert {file.name for file in (tmp_path / "run").iterdir()} == {
        file.name for file in alone[0].iterdir()
    }


@pytest.mark.e2e
def test_a_rank_that_dies_again_ends_the_run_in_words_and_overwrites_nothing(
    prepared, job, tmp_path
):
    folder = tmp_path / "run"
    killed_alone(prepared, folder)
    before = {file: file.read_bytes() for file in folder.rglob("*.safetensors")}
    over = threading.Event()

    def kill_always() -> None:
        while not over.wait(0.1):
            with suppress(ValueError, ProcessLookupError):
                kill_a_rank(folder)

    threading.Thread(target=kill_always).start()
    try:
        with pytest.raises(RanksFailed) as ended:
            Watcher().optimise(job, folder)
    finally:
        over.set()
    words = str(ended.value)
    assert "died again" in words
    assert str(folder) in words
    assert "--devices" in words
    assert "SIGKILL" in words
    assert {file: file.read_bytes() for file in folder.rglob("*.safetensors")} == before
    assert not (folder / JOB).exists()
    assert gone(folder, within_s=10.0)


RUN = """
import sys
from pathlib import Path
from mocoflow_core.training.job import read_job
from mocoflow_core.training.on_devices import Devices, optimise_on

def tell(*news): print(*news, flush=True)
def ignore(*news): pass

job, folder = map(Path, sys.argv[1:])
optimise_on(Devices(here=2), read_job(job), folder, tell, ignore, ignore, ignore)
"""


@pytest.mark.e2e
@pytest.mark.parametrize(
    ("how", "training"),
    [(signal.SIGTERM, True), (signal.SIGINT, False), (signal.SIGKILL, False)],
)
def test_nobody_is_left_when_a_run_is_told_to_end(job, tmp_path, how, training):
    """In the midst of training, or while the ranks start. SIGKILL reaches the run alone."""
    file, folder = tmp_path / "given.json", tmp_path / "run"
    file.write_text(changed(job, coarse_steps=10_000).model_dump_json())
    run = subprocess.Popen(
        [sys.executable, "-c", RUN, str(file), str(folder)],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        process_group=0,
    )
    if training:
        assert run.stdout.readline()
    while len(processes(folder)) < 3:
        assert run.poll() is None
        time.sleep(0.05)
    if how == signal.SIGKILL:
        run.kill()
    else:
        os.killpg(run.pid, how)
    assert gone(folder, within_s=30.0)
    assert run.wait(30.0) != 0
    assert not (folder / "model.safetensors").exists()


def test_a_job_that_is_not_there_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="first machine"):
        read_job(tmp_path / JOB)
