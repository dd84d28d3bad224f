"""The adaptive box of the paper: margins along the train camera's axes, slabs per ray."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mocoflow_core.geometry.rays import Rays
from mocoflow_core.rendering.frame_box import BoxConfig, FrameBoxes, frame_boxes
from tests.capsule_person import look_at

CAMERA = look_at([2.0, -3.0, 1.2], [0.0, 0.0, 0.9], 40.0, 32, 32)
BOX = BoxConfig()


def meshes() -> np.ndarray:
    """Three frames of a cloud that walks away."""
    points = np.random.default_rng(0).uniform(-0.4, 0.4, (60, 3))
    places = [np.array([0.0, 0.5 * frame, 0.9]) for frame in range(3)]
    return np.stack([points + place for place in places]).astype(np.float32)


def boxes(follows="frame") -> FrameBoxes:
    return frame_boxes(meshes(), np.array([0.0, 0.4, 1.0]), CAMERA, BOX, follows)


def test_margins_are_those_of_the_paper_with_z_along_the_view():
    turned = meshes() @ CAMERA.R.T.astype(np.float32)
    made = boxes()
    for row in range(3):
        below = turned[row].min(0) - made.lower[row].numpy()
        above = made.upper[row].numpy() - turned[row].max(0)
        assert below == pytest.approx([0.2, 0.2, 0.4], abs=1e-5)
        assert above == pytest.approx([0.2, 0.2, 0.4], abs=1e-5)


def test_one_box_for_the_clip_holds_the_boxes_of_all_frames():
    own, common = boxes(), boxes("clip")
    assert torch.equal(common.lower[0], common.lower[2])
    assert (common.lower[0] <= own.lower).all()
    assert (common.upper[0] >= own.upper).all()


def test_the_body_s_middle_is_its_own_also_where_one_box_holds_the_clip():
    for row in range(3):
        assert boxes("clip").middle(row) == pytest.approx(boxes().middle(row), abs=1e-5)
        inside = meshes()[row].min(0) < boxes().middle(row)
        assert (inside & (boxes().middle(row) < meshes()[row].max(0))).all()


def test_the_ray_through_the_middle_enters_and_leaves_whichever_camera_looks():
    made = boxes()
    for eye in ([2.0, -3.0, 1.2], [-4.0, 1.0, 2.0], [0.0, 6.0, 0.9]):
        origin = torch.tensor(eye)
        middle = torch.from_numpy(made.middle(1)).float()
        direction = torch.nn.functional.normalize(middle - origin, dim=0)
        near, far = made.intersect(Rays(origin[None], direction[None]), torch.tensor([1]))
        reach = float((middle - origin).norm())
        assert 0.0 < float(near) < reach < float(far)
        # By symmetry the middle lies half-way.
        assert float(near + far) == pytest.approx(2.0 * reach, abs=1e-4)


def test_each_ray_has_its_own_entry_not_one_of_the_image():
    made = boxes()
    centre = torch.from_numpy(CAMERA.centre_world).float()
    corner = torch.from_numpy(made.middle(0)).float() + torch.tensor([0.5, 0.5, 0.0])
    through = torch.stack([torch.from_numpy(made.middle(0)).float(), corner]) - centre
    rays = Rays(centre.expand(2, 3), torch.nn.functional.normalize(through, dim=1))
    near, far = made.intersect(rays, torch.zeros(2, dtype=torch.int64))
    assert (far > near).all()
    assert float((near[0] - near[1]).abs()) > 0.01


def test_a_ray_that_misses_has_its_exit_before_its_entry():
    ray = Rays(torch.tensor([[9.0, 9.0, 9.0]]), torch.tensor([[0.0, 0.0, 1.0]]))
    near, far = boxes().intersect(ray, torch.tensor([0]))
    assert float(far) <= float(near)


def test_between_frames_the_box_moves_evenly_and_the_file_holds_all(tmp_path):
    made = boxes()
    half = made.at(torch.tensor([0.2, 0.4], dtype=torch.float64))
    assert torch.allclose(half.lower[0], 0.5 * (made.lower[0] + made.lower[1]))
    assert torch.allclose(half.lower[1], made.lower[1])
    made.save(tmp_path)
    again = FrameBoxes.load(tmp_path)
    assert all(torch.equal(getattr(again, name), value) for name, value in vars(made).items())
