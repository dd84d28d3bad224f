from __future__ import annotations

import numpy as np
import pytest
import torch

from mocoflow_core.rendering.pixels import shell_pixels
from tests.capsule_person import look_at
from tests.rigid_figures import MOTIONS, near_surface, rigid_figure

SHELL_M = 0.06


@pytest.fixture(scope="module")
def rigid():
    return rigid_figure()


def camera(eye=(0.0, -2.0, 0.3), target=(0.0, 0.0, 0.0), focal: float = 90.0):
    return look_at(eye, target, focal, 80, 64)


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("distance", [1.0, 3.0, 20.0])
def test_every_visible_point_of_the_shell_has_its_pixel_and_depth(rigid, row, distance):
    rotation, shift = MOTIONS[row]
    view = camera(shift + distance * np.array([0.3, -1.0, 0.1]), shift)
    points = rotation.apply(near_surface(rigid.mesh, SHELL_M, count=3000)) + shift
    found = shell_pixels(view, rigid.body, row, SHELL_M)
    x, y = np.floor(view.project(points)).astype(int).T
    inside = (x >= 0) & (x < view.width) & (y >= 0) & (y < view.height)
    assert inside.sum() > 100
    flat = y[inside] * view.width + x[inside]
    place = np.searchsorted(found.pixels.numpy(), flat)
    assert np.array_equal(found.pixels.numpy()[place], flat)
    depth = view.to_camera(points[inside])[:, 2]
    assert (found.nearest.numpy()[place] <= depth + 1e-5).all()
    assert (found.farthest.numpy()[place] >= depth - 1e-5).all()


def test_pixels_are_few_and_in_order(rigid):
    found = shell_pixels(camera(), rigid.body, 0, SHELL_M)
    assert (found.pixels.diff() > 0).all()
    assert (found.nearest < found.farthest).all()
    # The body covers about a tenth of the picture at this distance.
    assert len(found.pixels) < 0.3 * 80 * 64


@pytest.mark.parametrize(
    "target", [(0.0, -4.0, 0.3), (9.0, -2.1, 0.3), (0.0, -2.0, 9.0)], ids=["behind", "beside", "up"]
)
def test_a_body_out_of_sight_has_no_pixels(rigid, target):
    view = camera((0.0, -2.0, 0.3), np.add(target, [1e-3, 1e-3, 0]))
    assert len(shell_pixels(view, rigid.body, 0, SHELL_M).pixels) == 0


def test_a_camera_inside_the_body_sees_it_everywhere(rigid):
    found = shell_pixels(camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)), rigid.body, 0, SHELL_M)
    assert len(found.pixels) == 80 * 64
    assert torch.isfinite(found.nearest).all()
    assert torch.isfinite(found.farthest).all()
