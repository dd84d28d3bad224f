from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.capture.scene import open_scene
from mocoflow_core.synthetic.background import render_background
from mocoflow_core.synthetic.camera_ring import camera_ring
from mocoflow_core.synthetic.pixel_rays import PixelBox
from mocoflow_core.synthetic.ray_caster import RayCaster
from mocoflow_core.synthetic.renderer import FrameRenderer
from mocoflow_core.synthetic.scene_writer import perform
from mocoflow_core.synthetic.texture import encode_srgb

FINE = 12  # Independent silhouettes are filled at this multiple of the image size.


@pytest.fixture(scope="module")
def truth(turn_scene):
    with np.load(turn_scene / "truth.npz") as arrays:
        return dict(arrays)


def _mask(folder, camera, frame):
    path = folder / f"masks/{camera}/{frame:06d}.png"
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 127


def _silhouette(camera, vertices, faces):
    """Share of each pixel that filled triangles cover: an oracle without rays."""
    canvas = np.zeros((camera.height * FINE, camera.width * FINE), np.uint8)
    # fillConvexPoly takes pixel centres at integers, in 1/16 pixel.
    corners = np.round((camera.project(vertices) * FINE - 0.5) * 16).astype(np.int32)
    for triangle in corners[faces]:
        cv2.fillConvexPoly(canvas, triangle, 1, shift=4)
    return canvas.reshape(camera.height, FINE, camera.width, FINE).mean(axis=(1, 3))


def test_masks_are_the_silhouettes_of_the_true_surface(turn_scene, truth):
    scene = open_scene(turn_scene)
    for name, camera in scene.cameras.items():
        mask = _mask(turn_scene, name, 2)
        share = _silhouette(camera, truth["vertices"][2].astype(float), truth["faces"])
        # Filled triangles include their outlines, so only clear cases are compared.
        assert mask[share > 0.95].all()
        assert not mask[share == 0].any()
        assert (mask & (share >= 0.5)).sum() / (mask | (share >= 0.5)).sum() > 0.98


def test_true_vertices_project_into_the_masks(turn_scene, truth):
    scene = open_scene(turn_scene)
    for name, camera in scene.cameras.items():
        for frame in range(4):
            grown = cv2.dilate(_mask(turn_scene, name, frame).astype(np.uint8), np.ones((3, 3)))
            pixels = np.floor(camera.project(truth["vertices"][frame].astype(float))).astype(int)
            assert grown[pixels[:, 1], pixels[:, 0]].mean() > 0.995


def test_a_pixel_shows_the_surface_point_whose_barycentric_mixture_projects_to_it(
    small_turn, person
):
    _, performance = perform(small_turn, person)
    camera = camera_ring(small_turn, performance.vertices)[1]
    vertices, faces = performance.vertices[3].astype(np.float32), performance.surface.faces
    directions = PixelBox.whole(camera).rays(camera, 1)
    centre = np.broadcast_to(camera.centre_world.astype(np.float32), directions.shape)
    hits = RayCaster(vertices, faces).hit(centre, directions)
    points = hits.interpolate(vertices, faces)
    pixels = camera.project(points.astype(float))
    expected = np.stack([hits.rays % camera.width, hits.rays // camera.width], axis=-1) + 0.5
    assert len(hits.rays) > 500
    # Embree works in float32 on metres: thousandths of a pixel.
    assert np.abs(pixels - expected).max() < 0.01


def test_occlusion_agrees_with_hits(small_turn, person):
    _, performance = perform(small_turn, person)
    camera = camera_ring(small_turn, performance.vertices)[0]
    directions = PixelBox.whole(camera).rays(camera, 1)
    centre = np.broadcast_to(camera.centre_world.astype(np.float32), directions.shape)
    caster = RayCaster(performance.vertices[0], performance.surface.faces)
    occluded = np.flatnonzero(caster.occluded(centre, directions))
    assert np.array_equal(occluded, caster.hit(centre, directions).rays)


def test_frames_show_the_background_wherever_the_person_is_not(turn_scene):
    for camera in ("cam00", "cam02"):
        frame = cv2.imread(str(turn_scene / f"frames/{camera}/000001.png"))
        plate = cv2.imread(str(turn_scene / f"background/{camera}.png"))
        grown = cv2.dilate(_mask(turn_scene, camera, 1).astype(np.uint8), np.ones((3, 3)))
        assert np.array_equal(frame[grown == 0], plate[grown == 0])


def test_the_light_of_a_surface_point_is_the_same_for_all_cameras(small_turn, person):
    _, performance = perform(small_turn, person)
    renderer = FrameRenderer(performance.surface, performance.vertices[0], "none")
    direct = RayCaster(performance.vertices[0], performance.surface.faces)
    cameras = camera_ring(small_turn.model_copy(update={"cameras": 8}), performance.vertices)
    chest = performance.vertices[0][performance.surface.faces].mean(axis=1)
    chest = chest[np.abs(chest - [0, -0.1, 1.2]).max(axis=1) < 0.08].astype(np.float32)
    seen = []
    for camera in cameras[:2]:
        centre = camera.centre_world.astype(np.float32)
        hits = direct.hit(np.broadcast_to(centre, chest.shape), chest - centre)
        points = hits.interpolate(
            performance.vertices[0].astype(np.float32), performance.surface.faces
        )
        same = np.linalg.norm(points - chest[hits.rays], axis=1) < 1e-4
        light = np.full((len(chest), 3), np.nan)
        light[hits.rays[same]] = renderer._shade(hits)[same]
        seen.append(light)
    difference = np.abs(seen[0] - seen[1])
    assert np.isfinite(difference).any()
    # Rounding moves a point by micrometres; a few of them cross a stripe's edge.
    assert np.nanquantile(difference, 0.95) < 1e-3


def test_the_texture_has_energy_at_the_scale_of_two_pixels(turn_scene):
    frame = cv2.imread(str(turn_scene / "frames/cam00/000000.png")).astype(np.float32) / 255
    inner = cv2.erode(_mask(turn_scene, "cam00", 0).astype(np.uint8), np.ones((5, 5))) > 0
    detail = frame - cv2.blur(frame, (3, 3))
    room = cv2.imread(str(turn_scene / "background/cam00.png")).astype(np.float32) / 255
    assert np.sqrt((detail[inner] ** 2).mean()) > 0.05
    assert np.sqrt(((room - cv2.blur(room, (3, 3))) ** 2).mean()) > 0.01


def test_front_and_back_differ(turn_scene):
    # Frame 0 shows the front, frame 2 of 4 the back; compare the colours of the chest.
    chest = [
        cv2.imread(str(turn_scene / f"frames/cam00/{frame:06d}.png"))[28:42, 42:54].mean(
            axis=(0, 1)
        )
        for frame in (0, 2)
    ]
    assert np.abs(chest[0] - chest[1]).max() > 15


def test_shadows_only_darken_and_only_near_the_person(small_turn, person):
    _, performance = perform(small_turn, person)
    camera = camera_ring(small_turn, performance.vertices)[0]
    background = render_background(camera, 2, seed=0)
    lit, shaded = (
        FrameRenderer(performance.surface, performance.vertices[0], kind).render(
            camera, background, 2
        )
        for kind in ("none", "cast")
    )
    assert np.array_equal(lit.mask, shaded.mask)
    drop = lit.rgb.astype(int) - shaded.rgb
    assert drop.min() >= 0
    outside = ~lit.mask
    assert (drop[outside].max(axis=-1) > 5).sum() > 50
    far = np.hypot(background.points[..., 0], background.points[..., 1]) > 3.2
    # Pixels on the outline show a little of the person, who shadows itself.
    outside = cv2.dilate(lit.mask.astype(np.uint8), np.ones((3, 3))) == 0
    assert drop[far & outside].max() == 0
    assert np.array_equal(encode_srgb(background.light)[far & outside], lit.rgb[far & outside])
