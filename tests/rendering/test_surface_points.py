from __future__ import annotations

import math

import numpy as np
import torch

from mocoflow_core.rendering.posed_scene import RenderedRays
from mocoflow_core.rendering.sampling import PackedSamples
from mocoflow_core.rendering.surface_points import half_opaque_points, surface_points
from mocoflow_core.rendering.trained_scene import TrainedScene
from tests.capsule_person import look_at


def crossing(density, step):
    """Two rays along z with samples from z = 1 on: the given density, and almost none."""
    count = len(density)
    distance = 1.0 + (torch.arange(count) + 0.5) * step
    points = torch.zeros(2 * count, 3)
    points[:, 2] = distance.repeat(2)
    ray = torch.arange(2).repeat_interleave(count)
    samples = PackedSamples(points, ray, torch.full((2 * count,), step))
    nothing = torch.empty(0)
    both = torch.cat([torch.as_tensor(density), torch.full((count,), 1e-3)])
    rendered = RenderedRays(nothing, nothing, samples, both)
    points, rays = half_opaque_points(rendered, torch.tensor([[0.0, 0.0, 1.0]]).repeat(2, 1))
    assert (rays == 0).all()
    return points


def test_constant_density_is_half_opaque_after_the_same_way_for_any_step():
    for step in (0.1, 0.01, 0.001):
        found = crossing(torch.full((round(1.0 / step),), 10.0), step)
        assert found.shape == (1, 3)
        assert abs(float(found[0, 2]) - (1.0 + math.log(2.0) / 10.0)) < 1e-6


def test_an_opaque_wall_is_met_at_its_front():
    density = torch.zeros(100)
    density[40:] = 1e5
    assert abs(float(crossing(density, 0.01)[0, 2]) - 1.4) < 1e-4


def test_every_point_comes_with_the_pixel_that_sees_it(prepared, trained):
    camera = prepared.clip.camera
    seen = surface_points(TrainedScene.open(trained), camera, 0.4)
    assert len(seen.points) > 50
    assert (np.diff(seen.pixels) > 0).all()
    column, row = np.floor(camera.project(seen.points)).astype(int).T
    assert np.array_equal(row * camera.width + column, seen.pixels)


def test_a_camera_that_looks_away_sees_no_surface(trained):
    away = look_at([0, -3, 1], [0, -9, 1], 40.0, 32, 32)
    seen = surface_points(TrainedScene.open(trained), away, 0.4)
    assert seen.points.shape == (0, 3)
    assert seen.pixels.shape == (0,)
