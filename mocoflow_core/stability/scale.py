"""The same person near and far, small and large, in few pixels and in many, far from the origin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rigid_controls import rigid_controls
from mocoflow_core.body.silhouette import silhouette
from mocoflow_core.capture.checks import check_capture
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.ingest import ingest_meshes
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import pixel_rays
from mocoflow_core.rendering.pixels import shell_pixels
from mocoflow_core.stability.case import Case, Found, largest, require
from mocoflow_core.stability.figures import torso_and_arm, turned
from mocoflow_core.stability.toy_scene import SHELL_M, recorded, toy

SINGLE = torch.finfo(torch.float32).eps
SIDE_PX = 64


def _camera_at(distance_m: float, side_px: int = SIDE_PX) -> Camera:
    """The toy's train camera moved along its viewing axis, the body's size in the image kept."""
    camera = toy().clip.camera.resized(side_px, side_px)
    middle = toy().meshes.vertices[0].mean(axis=0)
    depth = float(camera.to_camera(middle[None].astype(np.float64))[0, 2])
    K = camera.K.copy()
    K[:2, :2] *= distance_m / depth
    return replace(camera, K=K, t=camera.t + np.array([0.0, 0.0, distance_m - depth]))


def _missed(camera: Camera) -> Found:
    """Pixels of the body that no ray would be sent through, or whose depths leave the body out."""
    body = toy().meshes
    mask = silhouette(body.vertices[0], body.faces, camera)
    shell = shell_pixels(camera, toy().motion.body, 0, SHELL_M)
    reached = np.zeros(mask.size, bool)
    reached[shell.pixels.numpy()] = True
    points = body.vertices[0].astype(np.float64)
    columns, rows = np.floor(camera.project(points)).T
    inside = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    depths = camera.to_camera(points)[inside, 2]
    ahead = float(shell.nearest.min()) - depths.min() if inside.any() else 0.0
    require(ahead <= 0.0, f"the body sticks out of its shell by {ahead} m")
    words = f"{mask.sum()} pixels show the body"
    return Found(float((mask.ravel() & ~reached).sum()), (shell.nearest, shell.farthest), words)


def _distance(distance_m: float) -> Found:
    return _missed(_camera_at(distance_m))


def _resolution(side_px: float) -> Found:
    return _missed(_camera_at(3.0, int(side_px)))


def _aside(metres: float) -> Found:
    """The person walks out of the picture; a clip that never shows the person is refused."""
    camera = _camera_at(3.0, toy().clip.camera.width)
    camera = replace(camera, t=camera.t + np.array([metres, 0.0, 0.0]))
    found = _missed(camera)
    prepared = replace(toy(), clip=replace(toy().clip, camera=camera))
    try:
        drawn = prepared.pixels().batch(64, 4, torch.Generator().manual_seed(0))
    except InputError as error:
        require("in sight" in str(error) and metres > 2.0, f"refused without a cause: {error}")
        return Found(found.error, found.watched, f"refused: {error}")
    require(metres < 10.0, "rays through a picture that shows nobody")
    return Found(found.error, (*found.watched, drawn.near, drawn.far, drawn.rgb), found.remark)


def _ray_ends(distance_m: float) -> Found:
    """Where rays of a far camera meet the body: float32 against float64, metres."""
    camera = _camera_at(distance_m)
    pixels = torch.arange(SIDE_PX * SIDE_PX)
    rays, along = pixel_rays(camera, pixels)
    found = rays.at(along * distance_m).double().numpy()
    columns, rows = np.meshgrid(np.arange(SIDE_PX) + 0.5, np.arange(SIDE_PX) + 0.5)
    seen = np.stack([columns, rows, np.ones_like(rows)], -1).reshape(-1, 3)
    expected = camera.to_world(distance_m * seen @ np.linalg.inv(camera.K).T)
    return Found(largest(found - expected), (found,))


def _tiny_images(side_px: float) -> Found:
    """The first look at a capture whose pictures have next to no pixels."""
    side = int(side_px)
    camera = Camera("cam", side, side, np.eye(3) * [side, side, 1], np.eye(3), np.zeros(3))
    generator = np.random.default_rng(0)
    frames = generator.integers(0, 255, (3, side, side, 3), dtype=np.uint8)
    nothing = np.zeros(3, bool)
    clip = Clip(
        camera,
        12.0,
        np.arange(3, dtype=np.int32),
        frames,
        np.zeros((3, side, side), bool),
        ~nothing,
        nothing,
        frames[0],
    )
    findings = check_capture(clip, camera)
    return Found(findings.foreground_share, remark="; ".join(findings.warnings))


def _file_units(height: float) -> Found:
    """Bodies of any height in file units: those that are no metres are refused with a unit."""
    meshes = MeshSequence.load(recorded() / "meshes.npz")
    factor = np.float32(height / 1.7)
    scaled = replace(meshes, vertices=factor * meshes.vertices)
    words = _refusal(scaled)
    require(bool(words) == (not 0.5 < height < 7.0), f"taken or refused wrongly: {words!r}")
    require(not words or "multiply the vertices by" in words, f"no unit is named: {words}")
    return Found(0.0, remark=words)


def _refusal(meshes: MeshSequence) -> str:
    file = recorded().with_name("other-meshes.npz")
    meshes.save(file)
    try:
        ingest_meshes(open_scene(recorded()), file)
    except InputError as error:
        return str(error)
    return ""


def _offset(metres: float) -> Found:
    """A scene far from the world's origin: the motion measured there against that near it."""
    meshes = MeshSequence.load(recorded() / "meshes.npz")
    aside = np.array([metres, 0.0, 0.0], np.float32)
    moved = replace(meshes, vertices=meshes.vertices + aside)
    words = _refusal(moved)
    if metres > 1e4:
        require("origin" in words, f"coordinates without digits are taken: {words!r}")
        return Found(0.0, remark=words)
    require("origin" not in words, f"refused too early: {words}")
    rest, faces = torso_and_arm()
    frame = turned(rest, 150.0)
    far = rigid_controls(rest + aside, frame[None] + aside, faces, np.zeros(1), 0.2, 16)
    expected = turned(far.canonical - aside, 150.0)
    return Found(largest(far.observed[0] - aside - expected), (far.observed, far.rotations))


CASES = (
    Case(
        "distance",
        "a person at 1 m fills all directions, one at 50 m none",
        "distance, m",
        (1.0, 3.0, 10.0, 50.0),
        "every pixel of the silhouette gets rays",
        _distance,
        0.0,
        "px",
        "exact: a pixel without rays is a hole",
    ),
    Case(
        "resolution",
        "a person of few pixels, and of millions",
        "image side, px",
        (8.0, 64.0, 512.0, 2160.0, 3840.0),
        "every pixel of the silhouette gets rays",
        _resolution,
        0.0,
        "px",
        "exact: a pixel without rays is a hole",
        quick=False,
    ),
    Case(
        "leaving_the_image",
        "a person half in the picture, at its edge, and gone",
        "aside, m",
        (0.0, 0.5, 1.0, 1.5, 50.0),
        "every pixel of the silhouette gets rays; refused where there is none in the clip",
        _aside,
        0.0,
        "px",
        "exact: a pixel without rays is a hole",
    ),
    Case(
        "far_camera",
        "float32 positions far along a ray",
        "distance, m",
        (1.0, 10.0, 50.0, 150.0),
        "the same in float64",
        _ray_ends,
        lambda distance: 4 * SINGLE * (distance + 4.0),
        "m",
        "two roundings each of the camera's position and of the way along the ray",
    ),
    Case(
        "tiny_images",
        "patches of a quarter of the image have no pixel",
        "image side, px",
        (1.0, 2.0, 4.0, 7.0, 16.0),
        "no failure; no mask covers anything",
        _tiny_images,
        0.0,
        "",
        "exact: the masks are empty",
    ),
    Case(
        "height_in_file_units",
        "0.02 m is a figurine or a person in other units",
        "height",
        (0.02, 0.2, 1.0, 2.0, 20.0, 1700.0),
        "refused with the likely unit, or taken",
        _file_units,
        0.0,
        "",
        "a refusal has no error",
    ),
    Case(
        "far_from_the_origin",
        "coordinates of a map leave no digits for a body",
        "offset, m",
        (0.0, 10.0, 1e3, 9e3, 1e5, 1e6),
        "the rigid motion itself; refused beyond 10 km",
        _offset,
        lambda metres: 2 * SINGLE * (metres + 1.0),
        "m",
        "two roundings of the coordinates: 2 mm at 10 km, where clothes and masks err by more",
    ),
)
