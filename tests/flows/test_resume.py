"""A killed run goes on where it was and ends where an undisturbed one ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mocoflow_core.artifacts import SceneArtifact
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.io.store import Store

ROOT = Path(__file__).parents[2]
SETTINGS = ("schedule.coarse_steps=120", "schedule.checkpoint_every_s=0.1")


def started(scene, store, out):
    options = [part for setting in SETTINGS for part in ("--set", setting)]
    command = ["reconstruct", scene, "--preset", "toy", "--store", store, "--out", out, *options]
    return subprocess.Popen(
        [sys.executable, "-c", "from flows.command_line import main; main()", *map(str, command)],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )


def kill_after_the_first_checkpoint(process, store):
    for _ in range(30_000):
        if list(store.glob("optimise_scene/*.partial/checkpoint.safetensors")):
            break
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()


@pytest.mark.e2e
def test_a_run_killed_in_the_optimisation_ends_in_the_same_parameters(
    reconstruct, toy_scene, tmp_path
):
    killed, undisturbed = tmp_path / "killed", tmp_path / "undisturbed"
    kill_after_the_first_checkpoint(started(toy_scene, killed, tmp_path / "out"), killed)
    assert not list(killed.glob("optimise_scene/*/manifest.json"))

    models, tries = [], []
    for store, out in ((killed, tmp_path / "out"), (undisturbed, tmp_path / "other")):
        record = reconstruct(toy_scene, out, store=str(store), settings=SETTINGS)
        trained = Store(store).find(SceneArtifact, record.stage("optimise_scene").key)
        models.append(digest_file(Store(store).folder(trained) / "model.safetensors"))
        tries.append(trained.summary["tries"])
    assert tries == [2, 1]
    assert models[0] == models[1]
