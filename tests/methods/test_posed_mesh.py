from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.methods.posed_mesh import colour_mesh

SIZE, FRAMES, RADIUS = 48, 8, 0.5


def looking_from(angle: float) -> Camera:
    R = trimesh.transformations.rotation_matrix(angle, [0, 1, 0])[:3, :3]
    K = np.array([[90.0, 0, SIZE / 2], [0, 90.0, SIZE / 2], [0, 0, 1]])
    return Camera("cam", SIZE, SIZE, K, R, np.array([0, 0, 3.0]))


def paint(points: np.ndarray) -> np.ndarray:
    """A smooth colour for each direction from the sphere's centre."""
    return 0.5 + 0.45 * np.sin(4 * points / RADIUS + [0.0, 1.0, 2.0])


def photograph(camera: Camera, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The painted sphere turned by ``turn``, solved per pixel; 4 x 4 rays each, over grey."""
    fine = (np.arange(4 * SIZE) + 0.5) / 4
    u, v = np.meshgrid(fine, fine)
    rays = np.stack([u, v, np.ones_like(u)], -1) @ np.linalg.inv(camera.K).T @ camera.R
    origin = camera.centre_world
    a, b = (rays**2).sum(-1), rays @ origin
    root = b**2 - a * (origin @ origin - RADIUS**2)
    hit = root > 0
    points = origin + rays * ((-b - np.sqrt(np.maximum(root, 0))) / a)[..., None]
    image = np.where(hit[..., None], paint(points @ turn), 0.5)
    mean = image.reshape(SIZE, 4, SIZE, 4, 3).mean((1, 3))
    return mean, hit.reshape(SIZE, 4, SIZE, 4).mean((1, 3))


def turning(frame: int) -> np.ndarray:
    return trimesh.transformations.rotation_matrix(2 * np.pi * frame / FRAMES, [0, 1, 0])[:3, :3]


@pytest.fixture(scope="module")
def scene() -> tuple[Clip, MeshSequence]:
    camera = looking_from(0.0)
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    views = [photograph(camera, turning(frame)) for frame in range(FRAMES)]
    indices = np.arange(0, 3 * FRAMES, 3, dtype=np.int32)
    clip = Clip(
        camera=camera,
        fps=10.0,
        frame_indices=indices,
        frames=np.stack([(255 * rgb).round().astype(np.uint8) for rgb, _ in views]),
        masks=np.stack([cover > 0.5 for _, cover in views]),
        has_mask=np.ones(FRAMES, bool),
        held_out=np.arange(FRAMES) == 3,
        background=np.full((SIZE, SIZE, 3), 128, np.uint8),
    )
    vertices = np.stack([sphere.vertices @ turning(f).T for f in range(FRAMES)])
    return clip, MeshSequence(indices, vertices.astype(np.float32), sphere.faces.astype(np.int32))


def test_a_view_that_no_frame_showed_is_painted_like_the_truth(scene: tuple) -> None:
    clip, meshes = scene
    coloured = colour_mesh(clip, meshes)
    camera = looking_from(np.pi / 8)
    rgb, opacity = coloured.render(camera, meshes.vertices[0], np.full(3, 0.5))
    truth, cover = photograph(camera, np.eye(3))
    # The tessellated sphere is about 0.3 px smaller at its outline.
    assert np.abs(opacity - cover).mean() < 0.01
    inner = (cover == 1) & (opacity == 1)
    # Bilinear sampling of 48 px images blurs, so errors stay near 1/60 of the range.
    assert np.sqrt(((rgb - truth)[inner] ** 2).mean()) < 0.02


def test_nothing_is_coloured_by_a_frame_that_is_held_out_or_has_no_mask(scene: tuple) -> None:
    clip, meshes = scene
    noisy = clip.frames.copy()
    noisy[[3, 5]] = np.random.default_rng(0).integers(0, 256, noisy[:2].shape)
    has_mask = np.arange(FRAMES) != 5
    first = colour_mesh(replace(clip, has_mask=has_mask), meshes)
    second = colour_mesh(replace(clip, has_mask=has_mask, frames=noisy), meshes)
    np.testing.assert_array_equal(first.colours, second.colours)


def test_one_black_frame_of_many_does_not_darken_the_median(scene: tuple) -> None:
    clip, meshes = scene
    # The same pose seen five times, once black.
    rows = np.zeros(5, int)
    frames = clip.frames[rows].copy()
    frames[2] = 0
    indices = np.arange(5, dtype=np.int32)
    still = replace(
        clip,
        frame_indices=indices,
        frames=frames,
        masks=clip.masks[rows],
        has_mask=np.ones(5, bool),
        held_out=np.zeros(5, bool),
    )
    posed = MeshSequence(indices, meshes.vertices[rows], meshes.faces)
    black_free = replace(still, frames=clip.frames[rows])
    np.testing.assert_array_equal(
        colour_mesh(still, posed).colours, colour_mesh(black_free, posed).colours
    )


def test_a_body_part_hidden_behind_another_is_not_given_its_colour() -> None:
    camera = looking_from(0.0)
    front = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
    back = trimesh.creation.icosphere(subdivisions=3, radius=0.2)
    front.apply_translation([0, 0, -0.5])
    back.apply_translation([0, 0, 0.5])
    both = trimesh.util.concatenate([front, back])
    red = np.zeros((1, SIZE, SIZE, 3), np.uint8)
    red[..., 0] = 255
    clip = Clip(
        camera=camera,
        fps=10.0,
        frame_indices=np.zeros(1, np.int32),
        frames=red,
        masks=np.ones((1, SIZE, SIZE), bool),
        has_mask=np.ones(1, bool),
        held_out=np.zeros(1, bool),
        background=red[0],
    )
    meshes = MeshSequence(
        np.zeros(1, np.int32), both.vertices[None].astype(np.float32), both.faces.astype(np.int32)
    )
    coloured = colour_mesh(clip, meshes)
    points = coloured.subdivision.refine(both.vertices)
    assert not coloured.seen[points[:, 2] > 0].any()
    assert coloured.seen[points[:, 2] < -0.7].all()
    # Filled from the nearest seen vertex, even without a path along the surface.
    np.testing.assert_array_equal(coloured.colours, np.tile([1.0, 0, 0], (len(points), 1)))


def test_inside_out_faces_are_coloured_the_same(scene: tuple) -> None:
    clip, meshes = scene
    flipped = replace(meshes, faces=np.ascontiguousarray(meshes.faces[:, ::-1]))
    assert colour_mesh(clip, flipped).seen.mean() == pytest.approx(
        colour_mesh(clip, meshes).seen.mean(), abs=1e-3
    )


def test_pixels_beside_the_mesh_show_the_background_exactly(scene: tuple) -> None:
    clip, meshes = scene
    background = np.random.default_rng(0).random((SIZE, SIZE, 3)).astype(np.float32)
    rgb, opacity = colour_mesh(clip, meshes).render(clip.camera, meshes.vertices[0], background)
    empty = opacity == 0
    assert empty.any()
    np.testing.assert_array_equal(rgb[empty], background[empty])


def test_a_mesh_outside_every_mask_is_refused(scene: tuple) -> None:
    clip, meshes = scene
    with pytest.raises(InputError, match="no vertex inside a mask"):
        colour_mesh(replace(clip, masks=np.zeros_like(clip.masks)), meshes)
    with pytest.raises(InputError, match="train frame with a mask"):
        colour_mesh(replace(clip, has_mask=np.zeros(FRAMES, bool)), meshes)
