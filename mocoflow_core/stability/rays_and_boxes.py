"""Rays that run along slabs, boxes without inside, cameras and lenses at their extremes."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np
import torch
from scipy.spatial.transform import Rotation

from mocoflow_core.capture.undistort import WorkingView, distort
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.rays import Rays, intersect_boxes, pixel_rays
from mocoflow_core.rendering.sampling import march
from mocoflow_core.stability.case import Case, Found, largest, require

SINGLE = torch.finfo(torch.float32).eps
LOWER, UPPER = (-0.5, -0.4, -1.0), (0.5, 0.4, 1.0)
DISTANCE_M = 3.0


def _rays(origin: tuple[float, float, float], direction: tuple[float, float, float]) -> Rays:
    ways = torch.tensor([direction], dtype=torch.float64)
    ways = ways / ways.norm(dim=-1, keepdim=True)
    return Rays(torch.tensor([origin]), ways.float())


def _crossing(rays: Rays, lower: torch.Tensor, upper: torch.Tensor) -> tuple[float, float]:
    """Entry and exit of one ray, in extended precision, slab by slab."""
    near, far = np.longdouble(0), np.longdouble(np.inf)
    for axis in range(3):
        start = np.longdouble(float(rays.origins[0, axis]))
        way = np.longdouble(float(rays.directions[0, axis]))
        sides = [np.longdouble(float(box[axis])) for box in (lower, upper)]
        if way == 0:
            if not sides[0] <= start <= sides[1]:
                return math.inf, -math.inf
            continue
        first, second = sorted((side - start) / way for side in sides)
        near, far = max(near, first), min(far, second)
    return float(near), float(far)


def _against_slabs(rays: Rays, lower: torch.Tensor, upper: torch.Tensor) -> Found:
    near, far = (float(value) for value in intersect_boxes(rays, lower, upper))
    expected_near, expected_far = _crossing(rays, lower, upper)
    # A box that is thinner than a rounding of the distance may be missed.
    if expected_far - expected_near > 4 * SINGLE * DISTANCE_M:
        require(far > near, "a ray that hits is said to miss")
    require(expected_far > expected_near or far <= near, "a ray that misses is said to hit")
    if expected_far <= expected_near:
        return Found(0.0, remark="misses")
    return Found(max(abs(near - expected_near), abs(far - expected_far)), (near, far))


def _box() -> tuple[torch.Tensor, torch.Tensor]:
    return torch.tensor(LOWER), torch.tensor(UPPER)


def _almost_parallel(slope: float) -> Found:
    return _against_slabs(_rays((0.5, 0.1, -DISTANCE_M), (-slope, 0.0, 1.0)), *_box())


def _camera_inside(depth: float) -> Found:
    origin = (0.0, 0.1, LOWER[2] + depth)
    found = _against_slabs(_rays(origin, (0.0, 0.0, 1.0)), *_box())
    near, _ = intersect_boxes(_rays(origin, (0.0, 0.0, 1.0)), *_box())
    require(depth < 0 or float(near) == 0.0, "a camera inside must start at itself")
    return found


def _thin(thickness: float) -> Found:
    middle = torch.tensor([0.0, 0.0, 1.0])
    lower, upper = _box()
    lower, upper = lower - lower * middle, upper - upper * middle
    upper = upper + thickness * middle
    rays = _rays((0.1, 0.1, -DISTANCE_M), (0.02, 0.0, 1.0))
    found = _against_slabs(rays, lower, upper)
    near, far = intersect_boxes(rays, lower, upper)
    samples = march(
        rays, near, far, 0.01, torch.full((1,), 0.5), lambda points, _: points[:, 0] < 9
    )
    require(len(samples) <= math.ceil(thickness / 0.01) + 1, "samples outside the box")
    return Found(found.error, (samples.points,), f"{len(samples)} samples")


def _behind(distance: float) -> Found:
    lower, upper = _box()
    away = torch.tensor([0.0, 0.0, -distance])
    return _against_slabs(_rays((0.0, 0.0, 0.0), (0.01, 0.0, 1.0)), lower + away, upper + away)


def _marched(length: float) -> Found:
    """How much less than a ray's stretch its steps cover, or how much more than one step more."""
    rays, step = _rays((0.0, 0.0, 0.0), (0.0, 0.6, 0.8)), 0.01
    off = 0.0
    for jitter in (0.0, 0.5, 1.0 - 2**-20):
        start = torch.tensor([2.0])
        samples = march(
            rays, start, start + length, step, torch.tensor([jitter]), lambda p, _: p[:, 0] < 9
        )
        beyond = len(samples) * step - length
        off = max(off, -beyond, beyond - step)
    return Found(off)


def _pinhole(width: int, height: int, focal: tuple[float, float]) -> Camera:
    K = np.array([[focal[0], 0, width / 2], [0, focal[1], height / 2], [0, 0, 1.0]])
    turn = Rotation.from_rotvec([0.3, -1.1, 0.2]).as_matrix()
    return Camera("cam", width, height, K, turn, np.array([0.2, -0.1, DISTANCE_M]))


def _there_and_back(camera: Camera) -> Found:
    """Pixel centres -> rays -> points 3 m away -> pixels, in pixels."""
    count = camera.width * camera.height
    pixels = torch.arange(0, count, max(count // 4001, 1))
    rays, along = pixel_rays(camera, pixels)
    points = rays.at(torch.full((len(pixels),), DISTANCE_M)).double().numpy()
    centres = np.stack([pixels % camera.width, pixels // camera.width], -1) + 0.5
    return Found(largest(camera.project(points) - centres), (rays.directions, along))


def _pixel_rounding(camera: Camera) -> float:
    """Rounding of points 3 m away, and of the camera's centre, seen as pixels."""
    corner = 1 + (camera.width / camera.K[0, 0]) ** 2 + (camera.height / camera.K[1, 1]) ** 2
    size = DISTANCE_M + float(np.linalg.norm(camera.centre_world))
    return float(4 * SINGLE * size / DISTANCE_M * camera.K[:2, :2].max() * corner)


def _at_size(side: float) -> Camera:
    return _pinhole(int(side), int(side), (1.2 * side, 1.2 * side))


def _at_ratio(ratio: float) -> Camera:
    return _pinhole(64, 48, (80.0, 80.0 * ratio))


def _with(camera: Callable[[float], Camera]) -> tuple[Callable[[float], Found], Callable]:
    return lambda value: _there_and_back(camera(value)), lambda value: _pixel_rounding(
        camera(value)
    )


def _lens(k1: float) -> Found:
    """Our lens model against OpenCV's own; a lens that folds the image is refused in words."""
    camera = Camera(
        "cam",
        64,
        48,
        np.array([[50.0, 0, 31.0], [0, 55.0, 25.0], [0, 0, 1]]),
        np.eye(3),
        np.zeros(3),
        np.array([k1, 0.0, 1e-3, -1e-3, 0.0]),
    )
    try:
        WorkingView.of(camera, 512).image(np.zeros((48, 64, 3), np.uint8))
    except InputError as error:
        require("folds" in str(error) and k1 < -0.4, f"refused without a cause: {error}")
        return Found(0.0, remark=f"refused: {error}")
    require(k1 > -1.0, "a lens that folds the image is taken")
    columns, rows = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
    pixels = np.stack([columns, rows], -1).reshape(-1, 2)
    found = distort(pixels, camera)
    ideal = np.concatenate([pixels, np.ones((len(pixels), 1))], -1) @ np.linalg.inv(camera.K).T
    expected, _ = cv2.projectPoints(ideal, np.zeros(3), np.zeros(3), camera.K, camera.distortion)
    return Found(largest(found - expected[:, 0]), (found,))


_BOX_ROUNDING = "differences of coordinates up to 3, and a division: a few roundings of a distance"
_SIZES, _SIZE_BOUND = _with(_at_size)
_RATIOS, _RATIO_BOUND = _with(_at_ratio)

CASES = (
    Case(
        "axis_parallel_rays",
        "a slab divided by a direction of zero, from a point on the slab's own plane",
        "slope",
        (0.0, 1e-45, 1e-38, 1e-30, 1e-12, 1e-6, 1e-3),
        "slabs in extended precision; zero is parallel",
        _almost_parallel,
        16 * SINGLE * DISTANCE_M,
        "m",
        _BOX_ROUNDING,
    ),
    Case(
        "camera_inside_box",
        "the entry lies behind the camera",
        "depth inside, m",
        (-1e-3, 0.0, 1e-7, 1e-3, 1.0, 1.999),
        "slabs in extended precision",
        _camera_inside,
        16 * SINGLE * DISTANCE_M,
        "m",
        _BOX_ROUNDING,
    ),
    Case(
        "thin_box",
        "a box without any inside",
        "thickness, m",
        (0.0, 1e-38, 1e-7, 1e-3, 0.1),
        "slabs in extended precision; no samples outside",
        _thin,
        16 * SINGLE * DISTANCE_M,
        "m",
        _BOX_ROUNDING,
    ),
    Case(
        "box_behind_camera",
        "both crossings are negative",
        "distance behind, m",
        (0.9, 1.0, 1.1, 10.0, 1e6),
        "slabs in extended precision",
        _behind,
        16 * SINGLE * DISTANCE_M,
        "m",
        _BOX_ROUNDING,
    ),
    Case(
        "stretch_of_samples",
        "stretches of no length, and of lengths that are no multiple of the step",
        "length, m",
        (0.0, 1e-7, 0.0099, 0.01, 0.0101, 1.0, 7.77),
        "the stretch itself",
        _marched,
        16 * SINGLE * 8,
        "m",
        "a few roundings of a stretch of 8 m; one step may reach beyond it",
    ),
    Case(
        "image_size",
        "one pixel, and more pixels than a float32 has digits to spare for",
        "side, px",
        (1.0, 2.0, 3.0, 64.0, 512.0, 4096.0, 8192.0),
        "the pixel's own centre, by the camera's projection in float64",
        _SIZES,
        _SIZE_BOUND,
        "px",
        "rounding of the ray's points and its start in float32, times the focal length",
    ),
    Case(
        "non_square_pixels",
        "one axis counts its pixels in another unit",
        "fy / fx",
        (0.1, 0.5, 1.0, 2.0, 10.0),
        "the pixel's own centre, by the camera's projection in float64",
        _RATIOS,
        _RATIO_BOUND,
        "px",
        "rounding of the ray's points and its start in float32, times the longer focal length",
    ),
    Case(
        "strong_distortion",
        "a strong barrel distortion folds the corners back into the image",
        "k1 of the lens",
        (-1.0, -0.5, -0.3, -0.1, 0.0, 0.3, 1.0),
        "OpenCV's projection; a lens that folds is refused in words",
        _lens,
        1e-9,
        "px",
        "float64 roundings of pixel coordinates",
    ),
)
