from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from mocoflow_core.training.batches import TrainingPixels
from tests.toy_training import SHELL_M


@pytest.fixture(scope="module")
def pixels(prepared):
    return TrainingPixels(prepared.clip, prepared.scene())


def batch(pixels: TrainingPixels, seed: int = 0, rays: int = 500):
    return pixels.batch(rays, 4, torch.Generator().manual_seed(seed))


def seen_at(camera, rays) -> np.ndarray:
    """The pixels (R, 2) that rays go through, x and y."""
    return np.floor(camera.project(rays.at(torch.full((len(rays),), 3.0)).double().numpy())).astype(
        int
    )


def test_rays_carry_what_the_camera_saw_along_them(prepared, pixels):
    clip, found = prepared.clip, batch(pixels)
    frames = np.flatnonzero(~clip.held_out)[found.row.numpy()]
    x, y = seen_at(clip.camera, found.rays).T
    assert found.rgb.numpy() == pytest.approx(clip.frames[frames, y, x] / 255, abs=1e-6)
    assert np.array_equal(found.mask.numpy() > 0.5, clip.masks[frames, y, x])
    assert found.background.numpy() == pytest.approx(clip.background[y, x] / 255, abs=1e-6)


def test_held_out_frames_never_enter_a_batch(prepared):
    clip = prepared.clip
    magenta = np.array([255, 0, 255], np.uint8)
    frames = np.full_like(clip.frames, 90)
    frames[clip.held_out] = magenta
    planted = TrainingPixels(replace(clip, frames=frames), prepared.scene())
    for seed in range(5):
        assert batch(planted, seed).rgb.numpy() == pytest.approx(90 / 255)


def test_every_person_pixel_can_be_drawn(prepared, pixels):
    clip = prepared.clip
    rows = np.flatnonzero(~clip.held_out)
    drawn = np.zeros((len(rows), *clip.masks.shape[1:]), bool)
    for seed in range(40):
        found = batch(pixels, seed, rays=1000)
        x, y = seen_at(clip.camera, found.rays).T
        drawn[found.row.numpy(), y, x] = True
    # The exact meshes cover their masks; a pixel that is never drawn was never a candidate.
    missed = clip.masks[rows] & ~drawn
    assert missed.sum() == 0


def test_frames_are_drawn_evenly(pixels):
    rows = torch.cat([batch(pixels, seed, rays=64).row for seed in range(200)])
    share = torch.bincount(rows).double() / len(rows)
    assert share.numpy() == pytest.approx(1 / len(share), abs=0.05)


def test_the_shell_lies_between_near_and_far(prepared, pixels):
    found = batch(pixels)
    assert (found.near < found.far).all()
    assert (found.near > 0).all()
    steps = torch.linspace(0, 8, 400)
    points = found.rays.origins[:, None] + steps[None, :, None] * found.rays.directions[:, None]
    rows = found.row[:, None].expand(-1, 400).reshape(-1)
    body = prepared.motion.body
    near_body = body.near_body(points.reshape(-1, 3), rows, SHELL_M)
    corners = body.observed_grids.corners(points.reshape(-1, 3), rows)
    inside = body.distance(corners).abs() < SHELL_M
    shell = (near_body & inside).reshape(-1, 400)
    between = (steps >= found.near[:, None]) & (steps <= found.far[:, None])
    assert shell.any()
    assert not (shell & ~between).any()


def test_jitter_lies_in_a_step_and_the_seed_decides_everything(pixels):
    first, second, other = batch(pixels, 3), batch(pixels, 3), batch(pixels, 4)
    assert ((first.jitter >= 0) & (first.jitter < 1)).all()
    for name in ("row", "near", "far", "rgb", "jitter"):
        assert torch.equal(getattr(first, name), getattr(second, name))
    assert not torch.equal(first.jitter, other.jitter)


@pytest.mark.parametrize("rays", [1, 3, 7])
def test_any_number_of_rays_is_a_batch(pixels, rays):
    found = batch(pixels, rays=rays)
    assert len(found.rays) == len(found.row) == len(found.rgb) == rays


def test_frames_without_a_mask_say_so(prepared):
    clip = prepared.clip
    has_mask = clip.has_mask.copy()
    first = np.flatnonzero(~clip.held_out)[0]
    has_mask[first] = False
    found = batch(TrainingPixels(replace(clip, has_mask=has_mask), prepared.scene()))
    assert torch.equal(found.has_mask == 0, found.row == 0)


def test_a_frame_whose_person_is_out_of_sight_gives_no_rays(prepared):
    # Each frame in turn shows nobody: its body is moved behind the camera.
    clip, body = prepared.clip, prepared.motion.body
    camera = clip.camera
    behind = torch.from_numpy(10 * (camera.centre_world - [0, 0, 0.9])).float()
    for away in range(int((~clip.held_out).sum())):
        grids = body.observed_grids
        origin = grids.origin.clone()
        origin[away] += behind.to(origin)
        moved = type(body)(
            body.times,
            replace(grids, origin=origin),
            body.observed_maps,
            body.observed_distance,
            body.observed_facing,
            body.canonical_grid,
            body.canonical_maps,
        )
        scene = prepared.scene()
        scene.body = moved
        found = batch(TrainingPixels(clip, scene))
        assert not (found.row == away).any()
        assert torch.isfinite(found.near).all()
