"""What decides whether body meshes were ingested before: content, not places."""

from __future__ import annotations

import shutil

import pytest

from mocoflow_core.capture.scene import open_scene
from mocoflow_core.errors import InputError
from tasks.source import file_source, meshes_source
from tests.capsule_person import default_recipe, write_scene


@pytest.fixture
def scene(tmp_path):
    return open_scene(write_scene(tmp_path / "scene", default_recipe()))


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "results"
    (folder / "hps").mkdir(parents=True)
    (folder / "camera.npy").write_bytes(b"camera")
    (folder / "hps" / "hps_track_0.npy").write_bytes(b"track")
    return folder


def test_a_folder_is_its_content_wherever_it_lies(scene, folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "elsewhere")
    assert meshes_source(scene, copy).digest == meshes_source(scene, folder).digest


@pytest.mark.parametrize("changed", ["camera.npy", "hps/hps_track_0.npy", "hps/hps_track_1.npy"])
def test_a_changed_file_of_a_folder_is_another_source(scene, folder, changed):
    before = meshes_source(scene, folder).digest
    (folder / changed).write_bytes(b"another")
    assert meshes_source(scene, folder).digest != before


def test_files_that_no_reader_opens_do_not_count(scene, folder):
    before = meshes_source(scene, folder).digest
    (folder / "tram_output.mp4").write_bytes(b"video")
    assert meshes_source(scene, folder).digest == before


def test_a_renamed_frame_is_another_source(scene, folder):
    before = meshes_source(scene, folder).digest
    (folder / "hps" / "hps_track_0.npy").rename(folder / "hps" / "hps_track_1.npy")
    assert meshes_source(scene, folder).digest != before


def test_a_body_model_is_its_content(tmp_path):
    for name, content in (("a.pkl", b"model"), ("b.pkl", b"model"), ("c.pkl", b"another")):
        (tmp_path / name).write_bytes(content)
    first, same, other = (
        file_source(tmp_path / f"{name}.pkl", "--body-model").digest for name in "abc"
    )
    assert first == same != other
    assert file_source(None, "--body-model") is None
    with pytest.raises(InputError, match="--body-model must be a file"):
        file_source(tmp_path, "--body-model")
