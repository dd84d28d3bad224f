"""Bodies of AIST++ in its world, from written motions and from a real one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.datasets.aist import read_aist
from mocoflow_core.datasets.aist_bodies import posed_motion
from mocoflow_core.datasets.aist_configuration import AistConfig
from mocoflow_core.datasets.dataset_checks import check_dataset
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.aist_motion import read_motion
from mocoflow_core.metrics.mask_iou import mask_iou
from tests.datasets.aist_layout import SEQUENCE, write_aist
from tests.datasets.studio import Y_UP, studio
from tests.small_smpl import write_smpl

DATA = Path(__file__).parents[1] / "data/aist"
SCALING = 98.0
FRAMES = 15


@pytest.fixture(scope="module")
def model_file(tmp_path_factory):
    file = tmp_path_factory.mktemp("models") / "SMPL_MALE.pkl"
    write_smpl(file)
    return file


@pytest.fixture(scope="module")
def motion():
    """A person on the spot who turns and swings the arms; y up, centimetres."""
    share = np.linspace(0, 1, FRAMES)
    poses = np.zeros((FRAMES, 24, 3))
    poses[:, 0, 1] = share
    poses[:, 16, 2], poses[:, 17, 2] = -0.6 - 0.3 * np.sin(6 * share), 0.6
    translations = np.tile([5.0, 118.0, -8.0], (FRAMES, 1))
    return {
        "smpl_poses": poses.reshape(FRAMES, 72).astype(np.float32),
        "smpl_trans": translations.astype(np.float32),
        "smpl_scaling": np.array([SCALING], np.float32),
        "smpl_loss": 1.8,
    }


@pytest.fixture(scope="module")
def filmed(motion, model_file):
    """The definition: the scaled model, then moved, all in centimetres."""
    model = read_smpl_model(model_file)
    bodies = posed_vertices(model, motion["smpl_poses"].reshape(-1, 24, 3), np.zeros(10))
    world_m = (SCALING * bodies + motion["smpl_trans"][:, None]) / 100
    numbers = np.arange(FRAMES, dtype=np.int32)
    meshes = MeshSequence(numbers, (world_m @ Y_UP).astype(np.float32), model.faces)
    return studio(("c01", "c02", "c09"), Y_UP, meshes)


@pytest.fixture
def read(tmp_path, filmed, motion, model_file):
    def write_and_read(change=None, **settings):
        write_aist(tmp_path, filmed, motion | (change or {}))
        return read_aist(tmp_path, AistConfig(**{"body_model": model_file} | settings))

    return write_and_read


def test_bodies_are_those_that_were_written_and_every_check_holds(read, filmed):
    scene = read()
    np.testing.assert_allclose(scene.meshes.sequence.vertices, filmed.meshes.vertices, atol=1e-4)
    assert (scene.meshes.coordinates, scene.meshes.located) == ("world", True)
    fitted, favoured = scene.caveats
    assert "fitted to the evaluation cameras' pictures" in fitted
    assert "mask_iou and psnr_union favour these bodies" in favoured
    findings = check_dataset(scene)
    assert findings.measured["overlap at +0 of c09"] > 0.75


@pytest.mark.parametrize(
    "change",
    [
        {"smpl_scaling": np.float32(SCALING)},
        {"smpl_scaling": np.array([[SCALING]], np.float32)},
        {"smpl_scaling": SCALING},
        {"smpl_poses": "as documented"},
    ],
    ids=["0-d scaling", "(1, 1) scaling", "a number", "(N, 24, 3) poses"],
)
def test_variants_of_the_motion_mean_the_same(read, filmed, motion, change):
    if "smpl_poses" in change:
        change = {"smpl_poses": motion["smpl_poses"].reshape(-1, 24, 3)}
    scene = read(change)
    np.testing.assert_allclose(scene.meshes.sequence.vertices, filmed.meshes.vertices, atol=1e-4)


def test_either_unit_gives_the_same_pictures(read, filmed):
    """The body becomes SMPL's size, and the cameras move with it."""
    scene = read(scale="smpl")
    grown = 100 / SCALING
    np.testing.assert_allclose(
        scene.meshes.sequence.vertices, grown * filmed.meshes.vertices, atol=1e-4
    )
    for name, camera in filmed.cameras.items():
        found = scene.cameras[name].camera
        np.testing.assert_allclose(found.t, grown * camera.t, atol=1e-9)
        points = filmed.meshes.vertices[0, :5].astype(np.float64)
        np.testing.assert_allclose(found.project(grown * points), camera.project(points))
    assert any("98.00" in remark for remark in scene.remarks)


def test_the_floor_is_found_under_the_feet_and_told(read, filmed):
    lowest = np.median(filmed.meshes.vertices[..., 1].min(axis=1))
    assert any(f"the floor is at {lowest:.2f} m along +y" in remark for remark in read().remarks)


def test_who_dances_on_the_spot_is_no_part_of_the_plate(read, filmed):
    """A plain median would hold the body where it stands in most frames."""
    camera = read().cameras["c09"]
    for number, mask in camera.masks.read([0, 7, 14]):
        assert mask_iou(mask, filmed.masks["c09"][number]) > 0.75


def test_the_clip_ends_with_the_motion(read, motion):
    shorter = {key: motion[key][:-4] for key in ("smpl_poses", "smpl_trans")}
    scene = read(shorter)
    assert scene.cameras["c09"].frames.indices.tolist() == list(range(FRAMES - 4))
    assert any("c09 has 15 frames, the motion 11" in remark for remark in scene.remarks)


def test_a_frame_more_or_less_is_nothing_to_tell(read, motion):
    shorter = {key: motion[key][:-1] for key in ("smpl_poses", "smpl_trans")}
    assert not any("the motion 14" in remark for remark in read(shorter).remarks)


def test_without_the_model_the_error_says_which_one_and_what_works_without(read):
    with pytest.raises(InputError, match=r"male SMPL model.*bodies=none"):
        read(body_model=None)


def test_a_real_motion_stands_about_where_the_document_says(model_file):
    motion = read_motion(DATA / f"{SEQUENCE}.pkl")
    assert motion.poses.shape == (8, 24, 3)
    assert motion.scaling == pytest.approx(98.02, abs=0.01)
    meshes, _ = posed_motion(motion, np.arange(2, 6, dtype=np.int32), 0.01, model_file)
    assert meshes.sequence.frame_indices.tolist() == [2, 3, 4, 5]
    middle = meshes.sequence.vertices.mean(axis=(0, 1))
    assert 1.4 < middle[1] < 1.9
    one = replace(motion, translations_cm=np.zeros_like(motion.translations_cm))
    at_origin, _ = posed_motion(one, np.arange(2, 6, dtype=np.int32), 0.01, model_file)
    moved = meshes.sequence.vertices - at_origin.sequence.vertices
    np.testing.assert_allclose(moved.mean(axis=1), motion.translations_cm[2:6] / 100, atol=1e-4)
