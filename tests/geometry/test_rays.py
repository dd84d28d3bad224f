from __future__ import annotations

import numpy as np
import pytest
import torch

from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import Rays, intersect_boxes, pixel_rays
from tests.capsule_person import look_at

LOWER = torch.tensor([-1.0, -2.0, -3.0])
UPPER = torch.tensor([1.0, 2.0, 3.0])


def ray(origin, direction) -> Rays:
    towards = torch.tensor([direction], dtype=torch.float32)
    start = torch.tensor([origin], dtype=torch.float32)
    return Rays(start, torch.nn.functional.normalize(towards, dim=-1))


def crossing(origin, direction, lower=LOWER, upper=UPPER) -> tuple[float, float]:
    near, far = intersect_boxes(ray(origin, direction), lower, upper)
    return float(near), float(far)


def wide_pixel_camera() -> Camera:
    """A camera whose pixels are no squares and whose principal point is off the middle."""
    camera = look_at([0.4, -3.0, 1.7], [0.1, 0.2, 0.9], 60.0, 50, 30)
    K = np.array([[60.0, 0, 21.3], [0, 95.0, 17.9], [0, 0, 1]])
    return Camera("cam", 50, 30, K, camera.R, camera.t)


def test_every_pixel_centre_projects_back_to_itself():
    camera = wide_pixel_camera()
    pixels = torch.arange(camera.width * camera.height)
    rays, _ = pixel_rays(camera, pixels)
    points = rays.at(torch.full((len(rays),), 2.7))
    found = camera.project(points.double().numpy())
    expected = np.stack([pixels % camera.width, pixels // camera.width], -1) + 0.5
    # A float32 metre is 1e-7 exact, which is 1e-5 pixels at this focal length.
    assert found == pytest.approx(expected, abs=1e-4)


def test_directions_have_unit_length_and_start_at_the_camera():
    camera = wide_pixel_camera()
    rays, _ = pixel_rays(camera, torch.arange(100))
    assert rays.directions.norm(dim=-1).numpy() == pytest.approx(1.0, abs=1e-6)
    assert rays.origins[7].numpy() == pytest.approx(camera.centre_world, abs=1e-6)


def test_the_second_result_turns_depth_into_distance():
    camera = wide_pixel_camera()
    rays, along = pixel_rays(camera, torch.arange(camera.width * camera.height))
    points = rays.at(2.5 * along).double().numpy()
    assert camera.to_camera(points)[:, 2] == pytest.approx(2.5, abs=1e-5)


def test_an_image_of_one_pixel_has_one_ray():
    camera = Camera("cam", 1, 1, np.diag([1.0, 1.0, 1.0]), np.eye(3), np.zeros(3))
    rays, along = pixel_rays(camera, torch.tensor([0]))
    assert rays.directions[0].numpy() == pytest.approx(np.array([1, 1, 2]) / np.sqrt(6), abs=1e-6)
    assert float(along) == pytest.approx(np.sqrt(1.5), abs=1e-6)


def test_a_box_is_entered_and_left_where_it_should_be():
    assert crossing([-5, 0, 0], [1, 0, 0]) == pytest.approx((4, 6))
    assert crossing([0, 0, 9], [0, 0, -1]) == pytest.approx((6, 12))
    diagonal = crossing([-2, -2, 0], [1, 1, 0])
    assert diagonal == pytest.approx((np.sqrt(2), 3 * np.sqrt(2)))


def test_slabs_agree_with_walking_along_the_ray():
    generator = torch.Generator().manual_seed(0)
    origins = 2 * torch.randn(200, 3, generator=generator)
    directions = torch.nn.functional.normalize(torch.randn(200, 3, generator=generator), dim=-1)
    near, far = intersect_boxes(Rays(origins, directions), LOWER, UPPER)
    distance = torch.linspace(0, 20, 4001)
    points = origins[:, None] + distance[None, :, None] * directions[:, None]
    inside = ((points > LOWER) & (points < UPPER)).all(-1)
    between = (distance > near[:, None]) & (distance < far[:, None])
    # A point may be decided the other way where it lies on the border to rounding.
    on_border = ((distance - near[:, None]).abs() < 1e-4) | ((distance - far[:, None]).abs() < 1e-4)
    assert ((inside == between) | on_border).all()
    assert 20 < int((far > near).sum()) < 180


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_axis_parallel_rays_are_inside_a_slab_for_all_distances_or_for_none(axis, sign):
    direction = [0.0, 0.0, 0.0]
    direction[axis] = sign
    through, beside = [0.3, -0.4, 0.5], [0.3, -0.4, 0.5]
    through[axis] = -10.0 * sign
    beside[axis], beside[(axis + 1) % 3] = -10.0 * sign, 7.0
    half = float(UPPER[axis])
    assert crossing(through, direction) == pytest.approx((10 - half, 10 + half))
    near, far = crossing(beside, direction)
    assert far <= near


def test_a_ray_that_grazes_a_side_gives_no_nan():
    near, far = crossing([-5, 2, 0], [1, 0, 0])
    assert (near, far) == pytest.approx((4, 6))
    near, far = crossing([-5, 2, 0], [1, 1e-30, 0])
    assert np.isfinite([near, far]).all()


def test_a_camera_inside_the_box_starts_at_itself():
    assert crossing([0, 0, 0], [0, 1, 0]) == pytest.approx((0, 2))


def test_a_ray_that_misses_and_a_box_behind_the_camera_have_no_length():
    for origin, direction in (([-5, 0, 0], [0, 1, 0.01]), ([5, 0, 0], [1, 0.01, 0])):
        near, far = crossing(origin, direction)
        assert far <= near


def test_a_box_of_no_thickness_has_no_length():
    flat = torch.tensor([0.0, 2.0, 3.0])
    near, far = crossing([-5, 0, 0], [1, 0.1, 0.1], torch.tensor([0.0, -2.0, -3.0]), flat)
    assert far - near == pytest.approx(0, abs=1e-6)
    near, far = crossing([-5, 0, 0], [1, 0, 0], torch.zeros(3), torch.zeros(3))
    assert far <= near


def test_each_ray_has_its_own_box():
    rays = Rays(torch.zeros(2, 3), torch.tensor([[1.0, 0, 0], [1.0, 0, 0]]))
    lower = torch.tensor([[1.0, -1, -1], [5.0, -1, -1]])
    near, far = intersect_boxes(rays, lower, lower + 2.0)
    assert near.tolist() == [1.0, 5.0]
    assert far.tolist() == [3.0, 7.0]


def test_the_nearest_surface_of_a_box_is_never_cut_off():
    # One distance per image (to the box's corners) would cut the side that faces the camera.
    near, _ = crossing([0, -5, 0], [0, 1, 0])
    corners = torch.cartesian_prod(*torch.stack([LOWER, UPPER], 1))
    assert near < (corners - torch.tensor([0.0, -5, 0])).norm(dim=-1).min()


def test_selected_rays_are_the_chosen_ones():
    rays = Rays(torch.arange(12.0).reshape(4, 3), torch.ones(4, 3))
    chosen = rays.select(torch.tensor([3, 1]))
    assert len(chosen) == 2
    assert torch.equal(chosen.origins, rays.origins[[3, 1]])
