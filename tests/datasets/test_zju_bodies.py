"""Bodies of ZJU-MoCap from their parameters: turned about the world's origin."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trimesh import Trimesh

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.datasets.zju_bodies import BodySource, read_bodies
from mocoflow_core.errors import InputError
from tests.small_smpl import write_smpl

NUMBERS = np.arange(3, dtype=np.int32)


@pytest.fixture(scope="module")
def model_file(tmp_path_factory):
    file = tmp_path_factory.mktemp("models") / "SMPL_NEUTRAL.pkl"
    write_smpl(file)
    return file


@pytest.fixture(scope="module")
def parameters():
    """Three frames as they are stored, each (1, n), the first joint without rotation."""
    random = np.random.default_rng(0)
    shape = random.normal(0, 1, (1, 10))
    poses = random.normal(0, 0.3, (3, 1, 72))
    poses[..., :3] = 0
    return [
        {
            "Rh": random.normal(0, 1, (1, 3)),
            "Th": random.normal(0, 1, (1, 3)),
            "poses": pose,
            "shapes": shape,
        }
        for pose in poses
    ]


def write(folder, kind, contents):
    (folder / kind).mkdir()
    for number, content in enumerate(contents):
        np.save(folder / kind / f"{number}.npy", content)
    return folder


def expected(model_file, parameters, blend_shapes):
    """By the definition: model without root rotation, turned about the origin, moved."""
    model = read_smpl_model(model_file)
    bodies = []
    for one in parameters:
        pose, shape = one["poses"].reshape(1, 24, 3), one["shapes"][0]
        body = posed_vertices(model, pose, shape, pose_directions=blend_shapes)[0]
        bodies.append(body @ Rotation.from_rotvec(one["Rh"][0]).as_matrix().T + one["Th"])
    return np.stack(bodies)


@pytest.mark.parametrize(("kind", "blend_shapes"), [("new_params", True), ("params", False)])
def test_parameters_pose_the_neutral_model_about_the_origin(
    tmp_path, model_file, parameters, kind, blend_shapes
):
    folder = write(tmp_path, kind, parameters)
    meshes, _ = read_bodies(folder, NUMBERS, BodySource(body_model=model_file))
    wanted = expected(model_file, parameters, blend_shapes)
    np.testing.assert_allclose(meshes.sequence.vertices, wanted, atol=1e-5)
    other = expected(model_file, parameters, not blend_shapes)
    assert np.abs(meshes.sequence.vertices - other).max() > 1e-3


def test_new_vertices_and_new_params_of_a_model_are_the_same_bodies(
    tmp_path, model_file, parameters
):
    write(tmp_path, "new_params", parameters)
    write(tmp_path, "new_vertices", expected(model_file, parameters, True))
    stored, posed = (
        read_bodies(tmp_path, NUMBERS, BodySource(choice, body_model=model_file))[0].sequence
        for choice in ("new_vertices", "new_params")
    )
    np.testing.assert_allclose(stored.vertices, posed.vertices, atol=1e-5)
    np.testing.assert_array_equal(stored.faces, posed.faces)


def test_faces_can_come_from_the_model_of_any_gender_by_a_folder_of_models(
    tmp_path, model_file, parameters
):
    write(tmp_path, "new_vertices", expected(model_file, parameters, True))
    source = BodySource(body_model=model_file.parent)
    meshes, remarks = read_bodies(tmp_path, NUMBERS, source)
    assert len(meshes.sequence.faces) > 1000
    assert any("taken from SMPL_NEUTRAL.pkl" in remark for remark in remarks)


def test_old_parameters_are_told_to_bend_less_well(tmp_path, model_file, parameters):
    folder = write(tmp_path, "params", parameters)
    _, remarks = read_bodies(folder, NUMBERS, BodySource(body_model=model_file))
    assert any("without the pose blend shapes" in remark for remark in remarks)


def test_parameters_without_a_model_say_which_one_is_needed(tmp_path, parameters):
    folder = write(tmp_path, "new_params", parameters)
    with pytest.raises(InputError, match="neutral SMPL model"):
        read_bodies(folder, NUMBERS, BodySource())


@pytest.mark.parametrize(
    "spoilt",
    [{"Rh": np.zeros((1, 4))}, {"Th": np.full((1, 3), np.nan)}, {"poses": None}, {"shapes": []}],
)
def test_spoilt_parameters_are_refused_by_their_file(tmp_path, model_file, parameters, spoilt):
    folder = write(tmp_path, "new_params", [*parameters[:2], parameters[2] | spoilt])
    with pytest.raises(InputError, match=r"new_params/2\.npy"):
        read_bodies(folder, NUMBERS, BodySource(body_model=model_file))


@pytest.mark.parametrize("body", [np.zeros((5, 2)), np.full((5, 3), np.nan), {"Rh": 1}])
def test_spoilt_vertices_are_refused_by_their_file(tmp_path, model_file, body):
    folder = write(tmp_path, "new_vertices", [body] * 3)
    with pytest.raises(InputError, match=r"new_vertices/0\.npy"):
        read_bodies(folder, NUMBERS, BodySource(body_model=model_file))


def test_vertices_of_another_body_than_the_faces_are_refused(tmp_path, model_file):
    folder = write(tmp_path, "new_vertices", np.zeros((3, 100, 3)))
    with pytest.raises(InputError, match="100 vertices"):
        read_bodies(folder, NUMBERS, BodySource(body_model=model_file))


def test_faces_of_another_number_of_vertices_are_refused(tmp_path, model_file, parameters):
    """Faces of fewer vertices than the body has name none that is missing."""
    folder = write(tmp_path, "new_vertices", expected(model_file, parameters, True))
    small = Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    small.export(tmp_path / "small.obj")
    with pytest.raises(InputError, match="3 vertices"):
        read_bodies(folder, NUMBERS, BodySource(faces=tmp_path / "small.obj"))


def test_a_few_stray_bodies_do_not_cut_the_clip(tmp_path, model_file, parameters):
    write(tmp_path, "new_params", parameters)
    write(tmp_path, "new_vertices", expected(model_file, parameters, True)[:2])
    meshes, remarks = read_bodies(tmp_path, NUMBERS, BodySource(body_model=model_file))
    assert meshes.sequence.frame_indices.tolist() == NUMBERS.tolist()
    assert remarks[0] == "bodies are those of new_params"
