"""ZJU-MoCap and AIST folders are recognised, imported whole, and ready to be learned from."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.composite import RIM_PX, composite_clip
from mocoflow_core.capture.extract import CaptureConfig, extract_clip, extract_evaluation
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.datasets.detect import detect_kind
from mocoflow_core.datasets.import_dataset import configure, import_dataset
from mocoflow_core.errors import InputError
from tests.datasets.aist_layout import write_aist
from tests.datasets.studio import Y_UP, Z_DOWN, studio
from tests.datasets.zju_layout import write_faces, write_zju

FRAMES = 20


@pytest.fixture(scope="module")
def zju(tmp_path_factory):
    """The studio, its layout on disk, and the scene folder made of it by detection."""
    filmed = studio(("Camera_B1", "Camera_B2", "Camera_B3"), Z_DOWN, frames=FRAMES)
    folder = tmp_path_factory.mktemp("zju")
    source = write_zju(folder / "CoreView_377", filmed)
    faces = write_faces(folder / "smpl.obj", filmed)
    return filmed, source, imported(source, folder / "scene", f"faces={faces}")


@pytest.fixture(scope="module")
def aist(tmp_path_factory):
    filmed = studio(("c01", "c03", "c09"), Y_UP, frames=FRAMES)
    folder = tmp_path_factory.mktemp("aist")
    source = write_aist(folder / "aist", filmed, None)
    return filmed, source, imported(source, folder / "scene", "bodies=none", "train_camera=c01")


def imported(source, out, *settings):
    kind = detect_kind(source)
    import_dataset(kind, source, configure(kind, settings, None), out)
    return open_scene(out)


def set_before(scene, clip):
    behind = CaptureConfig().behind(scene)
    return composite_clip(scene, clip, behind, scene.masks(scene.train_camera))


def test_each_is_recognised(zju, aist):
    assert detect_kind(zju[1]).name == "zju-mocap"
    assert detect_kind(aist[1]).name == "aist"


def test_a_folder_of_subjects_and_a_look_alike_are_told(zju, tmp_path):
    with pytest.raises(InputError, match="CoreView_377"):
        detect_kind(zju[1].parent)
    (tmp_path / "annots_new.npy").touch()
    with pytest.raises(InputError, match="refined release"):
        detect_kind(tmp_path)


@pytest.mark.parametrize("which", ["zju", "aist"])
def test_the_scene_has_the_cameras_that_filmed(which, request):
    filmed, _, scene = request.getfixturevalue(which)
    assert set(scene.cameras) == set(filmed.cameras)
    for name, camera in filmed.cameras.items():
        for part in ("K", "R", "t"):
            found = getattr(scene.cameras[name], part)
            np.testing.assert_allclose(found, getattr(camera, part), atol=1e-9)


def test_the_clip_of_zju_is_white_around_the_person_at_12_per_second(zju):
    filmed, _, scene = zju
    seen = extract_clip(scene, CaptureConfig())
    clip = set_before(scene, seen)
    assert clip.fps == 12
    assert clip.frame_indices[~clip.held_out].tolist() == list(range(0, FRAMES, 2))
    np.testing.assert_array_equal(clip.masks, filmed.masks["Camera_B1"][clip.frame_indices])
    assert (clip.frames[~clip.masks] == 255).all()
    assert (clip.background == 255).all()
    assert (seen.frames[~seen.masks] != 255).mean() > 0.9  # What is behind can still be judged.
    bodies = MeshSequence.load(scene.meshes())
    np.testing.assert_allclose(bodies.vertices, filmed.meshes.vertices, atol=1e-5)


def test_the_clip_of_aist_stands_before_its_plate_at_12_per_second(aist):
    _, _, scene = aist
    seen = extract_clip(scene, CaptureConfig())
    clip = set_before(scene, seen)
    assert clip.fps == 12
    assert clip.frame_indices[~clip.held_out].tolist() == [0, 5, 10, 15]
    rim = np.ones((2 * RIM_PX + 1,) * 2, np.uint8)
    for frame, filmed, mask in zip(clip.frames, seen.frames, clip.masks, strict=True):
        beyond = cv2.dilate(mask.astype(np.uint8), rim) == 0
        np.testing.assert_array_equal(frame[beyond], clip.background[beyond])
        np.testing.assert_array_equal(frame[mask], filmed[mask])


def test_other_cameras_show_the_person_before_the_same(zju):
    _, _, scene = zju
    for view in extract_evaluation(scene, np.arange(6, dtype=np.int32), CaptureConfig()):
        assert (view.frames[~view.masks] == 255).all()


def test_what_the_scene_says_can_be_overruled_and_counts_in_what_is_learned(zju):
    _, _, scene = zju
    assert CaptureConfig(behind_person="kept").behind(scene) == "kept"
    assert scene.training_description()["behind_person"] == "white"


@pytest.mark.parametrize(("which", "working"), [("zju", [0, 2, 4]), ("aist", [0, 5, 10])])
def test_other_cameras_evaluate_the_frames_that_are_learned_from(which, working, request):
    _, _, scene = request.getfixturevalue(which)
    clip = extract_clip(scene, CaptureConfig())
    views = extract_evaluation(scene, clip.frame_indices, CaptureConfig())
    assert len(views) == 2
    for view in views:
        assert view.frame_indices[:3].tolist() == working


def test_bodies_that_saw_the_evaluation_cameras_are_said_to_have(zju, aist):
    _, _, scene = zju
    [remark] = scene.description.remarks
    assert "fitted to the evaluation cameras' pictures" in remark
    assert remark in json.loads((scene.root / "import.json").read_text())["remarks"]
    assert aist[2].description.remarks == []


def test_a_remark_changes_nothing_that_is_learned_from(zju):
    _, _, scene = zju
    bare = replace(scene, description=scene.description.model_copy(update={"remarks": []}))
    assert bare.training_description() == scene.training_description()
    assert bare.evaluation_description() == scene.evaluation_description()


@pytest.mark.parametrize("which", ["zju", "aist"])
def test_what_was_assumed_is_kept_beside_the_scene(which, request):
    _, source, scene = request.getfixturevalue(which)
    record = json.loads((scene.root / "import.json").read_text())
    assert record["source"] == str(source)
    assert any(remark.startswith("up is") for remark in record["remarks"])
    assert scene.description.license
    assert scene.description.attribution
