"""Same point, same colour: of a body whose motion is known."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mocoflow_core.body.rasterise import interpolate, rasterise
from mocoflow_core.capture.clip import Clip
from mocoflow_core.fields.canonical_density import CanonicalDensity
from mocoflow_core.fields.canonical_grid import CanonicalConfig
from mocoflow_core.fields.scene_shape import MotionConfig, SceneShape
from mocoflow_core.io.pictures import as_bytes, read_picture
from mocoflow_core.methods.correspondence_pictures import (
    colours_of_places,
    correspondence_picture,
    write_correspondences,
)
from mocoflow_core.rendering.shell_space import ShellSpace
from mocoflow_core.rendering.trained_scene import TrainedScene
from tests.capsule_person import look_at
from tests.one_thread import one_thread  # noqa: F401
from tests.rigid_figures import MOTIONS, REACH_M, rigid_figure
from tests.toy_training import silent

TIMES = (0.0, 0.5, 1.0)
SIZE = 48


@pytest.fixture(scope="module")
def figure():
    return rigid_figure()


@pytest.fixture(scope="module")
def scene(figure):
    """The ellipsoid that MOTIONS carries about; untrained, it is where its mesh is."""
    prior = figure.prior
    density = CanonicalDensity(
        np.asarray(figure.mesh.vertices, np.float32),
        np.asarray(figure.mesh.faces, np.int32),
        prior.lattice.numpy(),
        prior.origin.numpy(),
        prior.spacing,
    )
    shape = SceneShape(
        canonical=CanonicalConfig(finest_m=0.03, levels=2, sharpness_m=0.002),
        motion=MotionConfig(),
        times=TIMES,
        shell_width_m=REACH_M,
        inner_depth_m=0.04,
        step_m=0.004,
    )
    torch.manual_seed(0)
    space = ShellSpace(shape, density, figure.controls)
    return TrainedScene(space, space.build())


def camera_at(place):
    return look_at(np.add(place, [0.0, -1.5, 0.4]), place, 60.0, SIZE, SIZE)


@pytest.mark.parametrize("row", range(len(MOTIONS)))
def test_a_point_has_the_colour_of_its_place_on_the_body_wherever_it_went(figure, scene, row):
    rotation, shift = MOTIONS[row]
    rest, faces = np.asarray(figure.mesh.vertices), np.asarray(figure.mesh.faces, np.int32)
    camera = camera_at(shift)
    picture = correspondence_picture(scene, camera, TIMES[row])
    raster = rasterise(rotation.apply(rest) + shift, faces, camera)
    truth = interpolate(raster, faces, colours_of_places(rest, rest.astype(np.float32)))
    shown = picture.min(axis=-1) < 1.0
    both = shown & raster.covered
    assert both.sum() > 0.95 * raster.covered.sum()
    # A hundredth is 2 to 7 mm of this body.
    off = np.abs(picture - truth)[both]
    assert np.median(off) < 0.01
    assert np.percentile(off, 95) < 0.04


def test_beside_the_body_the_picture_is_white(scene, figure):
    picture = correspondence_picture(scene, camera_at((0.0, 0.0, 0.0)), 0.0)
    faces = np.asarray(figure.mesh.faces, np.int32)
    raster = rasterise(figure.mesh.vertices, faces, camera_at((0.0, 0.0, 0.0)))
    white = (picture == 1.0).all(axis=-1)
    assert (white & ~raster.covered).sum() > 0.95 * (~raster.covered).sum()


def test_every_axis_of_the_canonical_box_is_a_channel_of_its_own():
    box = np.array([[-1.0, 0.0, 2.0], [1.0, 4.0, 2.5]], np.float32)
    corners = np.array([[-1.0, 4.0, 2.25], [1.0, 0.0, 9.0]])
    expected = np.array([[0.0, 1.0, 0.5], [1.0, 0.0, 1.0]])
    assert colours_of_places(corners, box) == pytest.approx(expected)


def test_evenly_spread_frames_and_the_canonical_one_are_written(scene, tmp_path):
    camera, frames = camera_at((0.0, 0.0, 0.0)), 9
    clip = Clip(
        camera=camera,
        fps=5.0,
        frame_indices=np.arange(10, 10 + frames, dtype=np.int32),
        frames=np.zeros((frames, SIZE, SIZE, 3), np.uint8),
        masks=np.ones((frames, SIZE, SIZE), bool),
        has_mask=np.ones(frames, bool),
        held_out=np.zeros(frames, bool),
        background=np.zeros((SIZE, SIZE, 3), np.uint8),
    )
    write_correspondences(scene, clip, 11, 3, tmp_path, silent)
    assert {path.stem for path in tmp_path.iterdir()} == {"000010", "000011", "000014", "000018"}
    first = as_bytes(correspondence_picture(scene, camera, 0.0))
    assert np.array_equal(read_picture(tmp_path / "000010.png"), first)
