"""Blend skinning against transforms worked out by hand, and the symmetries it must have."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial.transform import Rotation

from mocoflow_core.body import blend_skinning
from mocoflow_core.body.blend_skinning import posed_joints, posed_vertices, rest_joints
from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.errors import InputError
from tests.small_smpl import small_smpl, write_smpl, write_smplx

QUARTER = np.pi / 2
REST = np.zeros((1, 24, 3))


@pytest.fixture(scope="module")
def model():
    """The small body in double precision."""
    arrays = small_smpl()
    return SmplModel(
        arrays["v_template"],
        arrays["f"].astype(np.int32),
        arrays["shapedirs"],
        arrays["posedirs"],
        arrays["J_regressor"],
        arrays["weights"],
        np.array([-1, *arrays["kintree_table"][0, 1:].astype(int)], np.int32),
    )


@pytest.fixture
def arm():
    """Two joints on the x axis, at 0 and 1, and a vertex on each bone and between them."""
    return SmplModel(
        template=np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0], [2, 0, 0], [1.5, 0, 0]]),
        faces=np.array([[0, 1, 2]], np.int32),
        shape_directions=np.zeros((5, 3, 1)),
        pose_directions=np.zeros((5, 3, 9)),
        joint_regressor=np.array([[1.0, 0, 0, 0, 0], [0, 1, 0, 0, 0]]),
        skinning_weights=np.array([[1.0, 0], [0, 1], [1, 0], [0, 1], [0.5, 0.5]]),
        parents=np.array([-1, 0], np.int32),
    )


@pytest.fixture
def poses():
    return np.random.default_rng(1).normal(0, 0.4, (5, 24, 3))


def test_an_arm_bends_as_worked_out_by_hand(arm):
    # Root a quarter turn about z: the arm points along y. Elbow another one: along -x from there.
    pose = np.array([[[0, 0, QUARTER], [0, 0, QUARTER]]])
    found = posed_vertices(arm, pose, [0.0])[0]

    # The last vertex is half way between (0, 1.5), with the root, and (-0.5, 1), with the elbow.
    expected = [[0, 0, 0], [0, 1, 0], [0, 0.5, 0], [-1, 1, 0], [-0.25, 1.25, 0]]
    np.testing.assert_allclose(found, expected, atol=1e-15)
    np.testing.assert_allclose(
        posed_joints(arm, pose, [0.0])[0], [[0, 0, 0], [0, 1, 0]], atol=1e-15
    )


def test_rotations_are_about_the_joint_and_not_about_the_origin(arm):
    arm.joint_regressor[0] = [0, 0, 1, 0, 0]  # the root stands at x = 0.5
    found = posed_vertices(arm, [[[0, 0, QUARTER], [0, 0, 0]]], [0.0])[0]

    np.testing.assert_allclose(found[[0, 3]], [[0.5, -0.5, 0], [0.5, 1.5, 0]], atol=1e-15)


def test_pose_directions_are_of_rotation_minus_identity_row_by_row(arm):
    arm.pose_directions[3, 2, :] = np.arange(9) * 0.01
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    pose = np.stack([np.eye(3), turn])[None]

    moved = posed_vertices(arm, pose, [0.0]) - posed_vertices(
        arm, pose, [0.0], pose_directions=False
    )

    raised = (np.arange(9) * 0.01) @ (turn - np.eye(3)).ravel()
    np.testing.assert_allclose(moved[0, 3], turn @ [0, 0, raised], atol=1e-15)
    assert not moved[0, :3].any()


def test_at_rest_the_body_is_the_template(model):
    with_directions = posed_vertices(model, REST, np.zeros(10))
    np.testing.assert_allclose(with_directions[0], model.template, rtol=0, atol=4e-16)
    assert np.array_equal(
        with_directions, posed_vertices(model, REST, np.zeros(10), pose_directions=False)
    )


def test_the_whole_body_against_a_plain_loop(model, poses):
    """The definition, vertex by vertex and with 4 x 4 matrices."""
    shape = np.random.default_rng(2).normal(0, 1, 10)
    found = posed_vertices(model, poses, shape, translation=[0.1, 0.2, 3.0])

    rest = model.template + model.shape_directions @ shape
    joints = model.joint_regressor @ rest
    for frame, pose in enumerate(poses):
        turns = Rotation.from_rotvec(pose).as_matrix()
        rest_posed = rest + model.pose_directions @ (turns[1:] - np.eye(3)).ravel()
        chain = []
        for joint, parent in enumerate(model.parents):
            local = np.eye(4)
            local[:3, :3] = turns[joint]
            local[:3, 3] = joints[joint] - (joints[parent] if parent >= 0 else 0)
            chain.append(chain[parent] @ local if parent >= 0 else local)
        for joint in range(24):
            chain[joint][:3, 3] -= chain[joint][:3, :3] @ joints[joint]
        blended = np.einsum("vj,jab->vab", model.skinning_weights, chain)
        points = np.concatenate([rest_posed, np.ones((len(rest), 1))], axis=1)
        expected = np.einsum("vab,vb->va", blended, points)[:, :3] + [0.1, 0.2, 3.0]
        np.testing.assert_allclose(found[frame], expected, atol=1e-13)


def test_matrices_and_axis_angles_give_the_same_body(model, poses):
    matrices = Rotation.from_rotvec(poses.reshape(-1, 3)).as_matrix().reshape(5, 24, 3, 3)
    np.testing.assert_allclose(
        posed_vertices(model, matrices, np.zeros(10)),
        posed_vertices(model, poses, np.zeros(10)),
        atol=1e-13,
    )


def test_a_translation_moves_every_vertex_by_itself(model, poses):
    moves = np.random.default_rng(3).normal(0, 2, (5, 3))
    difference = posed_vertices(model, poses, [0.0], moves) - posed_vertices(model, poses, [0.0])
    np.testing.assert_allclose(
        difference, np.broadcast_to(moves[:, None], difference.shape), atol=1e-13
    )


def test_turning_the_root_turns_the_body_about_its_pelvis(model, poses):
    turn = Rotation.from_rotvec([0.4, 1.2, -0.3])
    turned = poses.copy()
    turned[:, 0] = (turn * Rotation.from_rotvec(poses[:, 0])).as_rotvec()
    shape = [0.5, -1.0]
    pelvis = rest_joints(model, shape)[0]

    before, after = (posed_vertices(model, pose, shape) for pose in (poses, turned))
    expected = (before - pelvis) @ turn.as_matrix().T + pelvis
    np.testing.assert_allclose(after, expected, atol=1e-13)


def test_shape_moves_the_joints_with_the_body(model):
    tall, small = (rest_joints(model, [value]) for value in (2.0, -2.0))
    assert tall[15, 1] - tall[7, 1] > small[15, 1] - small[7, 1] + 0.1
    np.testing.assert_allclose(
        posed_joints(model, REST, [2.0])[0],
        model.joint_regressor @ posed_vertices(model, REST, [2.0], pose_directions=False)[0],
        atol=1e-13,
    )


def test_a_shape_for_each_frame(model, poses):
    shapes = np.random.default_rng(4).normal(0, 1, (5, 10))
    together = posed_vertices(model, poses, shapes)
    alone = [posed_vertices(model, poses[i : i + 1], shapes[i])[0] for i in range(5)]
    np.testing.assert_allclose(together, alone, atol=1e-13)


def test_offsets_are_worn_on_the_shaped_body_and_move_no_joint(model, poses):
    offsets = np.full((model.vertex_count, 3), [0.0, 0.0, 0.05])
    worn = posed_vertices(model, poses, [1.0], offsets=offsets)
    bare = posed_vertices(model, poses, [1.0])

    blended = np.einsum("vj,jab->vab", model.skinning_weights, _global_turns(model, poses[0]))
    np.testing.assert_allclose((worn - bare)[0], blended @ [0, 0, 0.05], atol=1e-13)


def _global_turns(model, pose):
    turns = []
    for joint, parent in enumerate(model.parents):
        own = Rotation.from_rotvec(pose[joint]).as_matrix()
        turns.append(own if parent < 0 else turns[parent] @ own)
    return np.array(turns)


def test_joints_that_are_not_given_stay_at_rest(tmp_path):
    write_smplx(tmp_path / "SMPLX.npz", 600)
    model = read_smpl_model(tmp_path / "SMPLX.npz")
    body = np.random.default_rng(5).normal(0, 0.3, (2, 22, 3))
    full = np.concatenate([body, np.zeros((2, 33, 3))], axis=1)

    assert np.array_equal(posed_vertices(model, body, [0.0]), posed_vertices(model, full, [0.0]))


def test_portions_of_frames_change_nothing(model, monkeypatch):
    poses = np.random.default_rng(6).normal(0, 0.3, (7, 24, 3))
    whole = posed_vertices(model, poses, np.zeros((7, 10)), np.ones((7, 3)))
    monkeypatch.setattr(blend_skinning, "PORTION_BYTES", 1)
    one_by_one = posed_vertices(model, poses, np.zeros((7, 10)), np.ones((7, 3)))
    np.testing.assert_allclose(one_by_one, whole, atol=1e-13)


def test_memory_stays_bounded_over_many_frames(model):
    portions = list(blend_skinning._portions(1000, model))
    transforms = model.vertex_count * 12 * 8
    assert all((p.stop - p.start) * transforms <= blend_skinning.PORTION_BYTES for p in portions)
    assert np.concatenate([np.arange(1000)[p] for p in portions]).tolist() == list(range(1000))


def test_single_precision_is_good_to_a_hundredth_of_a_millimetre(model, poses):
    single = SmplModel(
        model.template.astype(np.float32),
        model.faces,
        *(
            np.asarray(getattr(model, name), np.float32)
            for name in (
                "shape_directions",
                "pose_directions",
                "joint_regressor",
                "skinning_weights",
            )
        ),
        model.parents,
    )
    exact = posed_vertices(model, poses, np.ones(10))
    found = posed_vertices(single, poses, np.ones(10))
    assert found.dtype == np.float32
    assert np.abs(found - exact).max() < 1e-5


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((np.zeros((2, 25, 3)), np.zeros(10)), r"pose must be \(T, 24, 3\) or"),
        ((np.zeros((2, 72)), np.zeros(10)), "pose must be"),
        ((np.zeros((2, 24, 4)), np.zeros(10)), "pose must be"),
        ((np.full((2, 24, 3), np.nan), np.zeros(10)), "pose must be finite"),
        ((np.zeros((2, 24, 3)), np.zeros(11)), "shape must be at most 10 coefficients"),
        ((np.zeros((2, 24, 3)), np.zeros((3, 10))), r"shape must be \(S,\) or \(2, S\)"),
        ((np.zeros((2, 24, 3)), np.zeros(10), np.zeros((3, 3))), "translation must be"),
        ((np.zeros((2, 24, 3)), np.zeros(10), None, np.zeros((5, 3))), "offsets must be"),
    ],
)
def test_sizes_that_do_not_fit_the_model_are_said(model, arguments, said):
    with pytest.raises(InputError, match=said):
        posed_vertices(model, *arguments)


def test_the_made_person_is_a_person(model):
    """Other tests stand on it: one closed surface, outward, of sensible size."""
    body = trimesh.Trimesh(model.template, model.faces, process=False)
    assert body.is_watertight
    assert body.euler_number == 2
    assert 0.06 < body.volume < 0.1
    assert 1.6 < np.ptp(model.template[:, 1]) < 1.8
    np.testing.assert_allclose(rest_joints(model, [0.0])[0], [0, -0.22, 0.02], atol=1e-12)
    assert model.template[model.skinning_weights[:, 10] > 0.9, 2].mean() > 0.1  # toes forward
    assert model.template[model.skinning_weights[:, 22] > 0.9, 0].mean() > 0.7  # left hand at +x
    assert ((model.skinning_weights > 0).sum(axis=1) <= 4).all()


def test_smplx_package_agrees(tmp_path):
    smplx = pytest.importorskip(
        "smplx", reason="smplx's licence is non-commercial: who may use it installs it by hand"
    )
    arrays = small_smpl()
    path = tmp_path / "SMPL_NEUTRAL.npz"
    write_smpl(path)
    model = read_smpl_model(path)
    poses = np.random.default_rng(7).normal(0, 0.4, (3, 24, 3)).astype(np.float32)
    other = smplx.lbs.lbs(
        torch.zeros(3, 10) + 0.5,
        torch.from_numpy(poses.reshape(3, 72)),
        *(
            torch.from_numpy(np.asarray(a, np.float32))
            for a in (
                arrays["v_template"],
                arrays["shapedirs"],
                arrays["posedirs"].reshape(-1, 207).T,
                arrays["J_regressor"],
            )
        ),
        torch.from_numpy(model.parents.astype(np.int64)),
        torch.from_numpy(model.skinning_weights),
    )[0]
    np.testing.assert_allclose(posed_vertices(model, poses, np.full(10, 0.5)), other, atol=1e-5)
