"""Nothing of the evaluation cameras or the truth reaches the trained parameters."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.request import Request
from mocoflow_core.io.content_key import digest_file


@pytest.fixture
def scene(toy_scene, tmp_path):
    return shutil.copytree(toy_scene, tmp_path / "scene")


def replace_by_noise(scene):
    generator = np.random.default_rng(0)
    for camera in ("cam01", "cam02"):
        for folder in ("frames", "masks"):
            for path in (scene / folder / camera).iterdir():
                shape = np.asarray(Image.open(path)).shape
                noise = generator.integers(0, 256, shape, dtype=np.uint8)
                Image.fromarray(noise).save(path)


def move(scene):
    description = json.loads((scene / "scene.json").read_text())
    for name in ("cam01", "cam02"):
        description["cameras"][name]["t"][2] += 0.5
    (scene / "scene.json").write_text(json.dumps(description))


def remove(scene):
    description = json.loads((scene / "scene.json").read_text())
    for name in ("cam01", "cam02"):
        del description["cameras"][name]
        shutil.rmtree(scene / "frames" / name)
        shutil.rmtree(scene / "masks" / name)
    (scene / "scene.json").write_text(json.dumps(description))


def forget_the_truth(scene):
    description = json.loads((scene / "scene.json").read_text())
    (scene / description.pop("truth")["file"]).unlink()
    (scene / "scene.json").write_text(json.dumps(description))


def parameters(record):
    key = record.stage("optimise_scene").key
    return digest_file(Path(record.store) / "optimise_scene" / key / "model.safetensors")


@pytest.mark.parametrize("change", [replace_by_noise, move, remove, forget_the_truth])
def test_the_training_side_does_not_see_it(
    change, scene, toy_scene, first_run, reconstruct, tmp_path
):
    change(scene)
    _, undisturbed = first_run
    changed = reconstruct(scene, tmp_path / "out", store=str(tmp_path / "fresh"))
    assert not changed.stage("optimise_scene").cached
    assert parameters(changed) == parameters(undisturbed)


def test_a_score_that_ends_a_run_is_not_of_another_camera(scene, toy_scene, reconstruct, tmp_path):
    """Stopping at a score of another camera would be learning from it."""
    asked = {"until": "train_psnr=20", "settings": ("schedule.until_every=1",)}
    undisturbed = reconstruct(toy_scene, tmp_path / "first", **asked)
    replace_by_noise(scene)
    changed = reconstruct(scene, tmp_path / "out", store=str(tmp_path / "fresh"), **asked)
    assert not changed.stage("optimise_scene").cached
    assert parameters(changed) == parameters(undisturbed)


def test_a_former_train_camera_is_as_unseen_as_the_others(toy_scene, reconstruct, tmp_path):
    """Its pictures may be anything; only its meshes are used, which the run says."""

    def replaced(scene):
        files = (scene / "frames" / "cam00").iterdir()
        for number, path in enumerate(sorted(files)):
            shape = np.asarray(Image.open(path)).shape
            noise = np.random.default_rng(number).integers(0, 256, shape, dtype=np.uint8)
            Image.fromarray(noise).save(path)
        return scene

    elsewhere = {"settings": ("capture.train_camera=cam01",)}
    first = reconstruct(toy_scene, tmp_path / "first", **elsewhere)
    assert first.train_camera == "cam01"
    assert any("given for cam00" in warning for warning in first.warnings)
    assert set(first.scores["mocoflow"]) >= {"cam00", "cam02"}
    scene = replaced(shutil.copytree(toy_scene, tmp_path / "scene"))
    changed = reconstruct(scene, tmp_path / "out", store=str(tmp_path / "fresh"), **elsewhere)
    assert not changed.stage("optimise_scene").cached
    assert parameters(changed) == parameters(first)


def test_what_the_metrics_read_does_change(scene, toy_scene, tmp_path):
    def others(path):
        return Request(scene_path=path).others.digest

    assert others(scene) == others(toy_scene)
    replace_by_noise(scene)
    assert others(scene) != others(toy_scene)
