"""The light is what makes a turning body brighter to one side, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocoflow_core.body.light import LightConfig, measure_light
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rasterise import interpolate, rasterise
from mocoflow_core.capture.clip import Clip
from mocoflow_core.planning.configuration import PlanConfig
from tests.capsule_person import capsule_person, look_at

FRAMES = 12
WIDTH, HEIGHT = 64, 96
MIDDLE = np.array([0, 0, 0.9])
UNSHADED = (0.0, 0.0, 0.0)


def posed(turns: Rotation) -> MeshSequence:
    """A person turned as a whole about its middle."""
    rest = capsule_person([0], [0], [np.zeros(3)])
    vertices = [turn.apply(rest.vertices[0] - MIDDLE) + MIDDLE for turn in turns]
    indices = np.arange(len(vertices), dtype=np.int32)
    return MeshSequence(indices, np.asarray(vertices, np.float32), rest.faces)


def tumbling() -> MeshSequence:
    share = np.linspace(0, 1, FRAMES)
    bends = [np.sin(7 * share), 0.8 * np.cos(5 * share) - 0.8, 6 * share]
    return posed(Rotation.from_rotvec(np.stack(bends, -1)))


def standing() -> MeshSequence:
    return posed(Rotation.from_rotvec(np.tile([0, 0, 0.3], (FRAMES, 1))))


def normals(vertices, faces):
    corners = vertices[faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(vertices)
    np.add.at(total, faces, flat[:, None])
    return total


def filmed(meshes: MeshSequence, light, noise: float = 0.0) -> Clip:
    """A textured body in linear light ``1 + light . normal``, encoded as sRGB."""
    camera = look_at([0, -3.5, 1.2], MIDDLE, 1.5 * HEIGHT, WIDTH, HEIGHT)
    draw = np.random.default_rng(5)
    waves, phase = draw.normal(0, 8, (3, 3)), draw.uniform(0, 6, 3)
    colours = 0.35 + 0.2 * np.sin(meshes.vertices[0] @ waves + phase)
    frames, masks = [], []
    for vertices in meshes.vertices.astype(np.float64):
        raster = rasterise(vertices, meshes.faces, camera)
        facing = interpolate(raster, meshes.faces, normals(vertices, meshes.faces))
        facing /= np.maximum(np.linalg.norm(facing, axis=-1, keepdims=True), 1e-12)
        shade = (1 + facing @ np.asarray(light)) / (1 + np.linalg.norm(light))
        linear = interpolate(raster, meshes.faces, colours) * shade[..., None]
        encoded = 255 * np.where(
            linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055
        )
        encoded = encoded + draw.normal(0, noise, encoded.shape)
        frames.append(np.where(raster.covered[..., None], encoded.round().clip(0, 255), 255))
        masks.append(raster.covered)
    return Clip(
        camera=camera,
        fps=12.0,
        frame_indices=meshes.frame_indices,
        frames=np.asarray(frames, np.uint8),
        masks=np.asarray(masks),
        has_mask=np.ones(len(frames), bool),
        held_out=np.zeros(len(frames), bool),
        background=np.full((HEIGHT, WIDTH, 3), 255, np.uint8),
    )


@pytest.fixture(scope="module")
def meshes():
    return tumbling()


@pytest.mark.parametrize("light", [(0.5, -0.2, 0.3), (-0.3, 0.2, 0.0), (0.1, 0.0, -0.15)])
@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_the_light_of_a_turning_body_is_found(meshes, light, noise):
    found = measure_light(filmed(meshes, light, noise), meshes, LightConfig())
    assert found == pytest.approx(light, abs=0.05)


def test_less_pull_finds_a_strong_light_from_the_camera_too(meshes):
    light = (0.0, -0.6, 0.3)
    found = measure_light(filmed(meshes, light), meshes, LightConfig(ridge=1e-4))
    assert found == pytest.approx(light, abs=0.05)


@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_a_texture_alone_is_no_light(meshes, noise):
    found = measure_light(filmed(meshes, UNSHADED, noise), meshes, LightConfig())
    assert np.linalg.norm(found) < 0.5 * PlanConfig().faint_light


def test_a_texture_on_a_body_that_is_a_centimetre_off_is_still_faint(meshes):
    clip = filmed(meshes, UNSHADED, 3.0)
    shifts = np.random.default_rng(2).normal(0, 0.01, (FRAMES, 1, 3))
    moved = replace(meshes, vertices=(meshes.vertices + shifts).astype(np.float32))
    assert np.linalg.norm(measure_light(clip, moved, LightConfig())) < PlanConfig().faint_light


def test_which_way_the_faces_wind_does_not_matter(meshes):
    clip = filmed(meshes, (0.4, 0.0, 0.2))
    turned = replace(meshes, faces=meshes.faces[:, ::-1].copy())
    found = measure_light(clip, turned, LightConfig())
    assert found == pytest.approx(measure_light(clip, meshes, LightConfig()), abs=1e-3)


def test_a_body_that_does_not_turn_tells_nothing():
    still = standing()
    found = measure_light(filmed(still, (0.5, -0.2, 0.3)), still, LightConfig())
    assert found == pytest.approx(np.zeros(3), abs=1e-3)


def test_a_single_frame_tells_nothing(meshes):
    clip = filmed(meshes, (0.5, -0.2, 0.3))
    alone = replace(clip, held_out=np.arange(FRAMES) > 0)
    assert measure_light(alone, meshes, LightConfig()) == pytest.approx(np.zeros(3), abs=1e-9)


def test_held_out_frames_are_not_looked_at(meshes):
    held_out = np.arange(FRAMES) % 4 == 1
    clip = replace(filmed(meshes, (0.5, -0.2, 0.3)), held_out=held_out)
    frames, masks = clip.frames.copy(), clip.masks.copy()
    frames[held_out] = np.random.default_rng(0).integers(0, 255, frames[held_out].shape)
    masks[held_out] = ~masks[held_out]
    spoilt = replace(clip, frames=frames, masks=masks)
    found = [measure_light(seen, meshes, LightConfig()) for seen in (clip, spoilt)]
    assert np.array_equal(*found)


@pytest.mark.parametrize("known", [True, False])
def test_without_any_mask_there_is_no_light(meshes, known):
    clip = filmed(meshes, (0.5, -0.2, 0.3))
    nobody = replace(clip, masks=clip.masks & False, has_mask=np.full(FRAMES, known))
    assert np.array_equal(measure_light(nobody, meshes, LightConfig()), np.zeros(3))


def test_no_surface_gets_negative_light(meshes):
    clip = filmed(meshes, (0.0, 0.0, 0.95))
    found = measure_light(clip, meshes, LightConfig(ridge=1e-4, largest=0.4))
    assert np.linalg.norm(found) == pytest.approx(0.4)
