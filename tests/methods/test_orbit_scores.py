from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.methods.orbit_scores import (
    ORBIT,
    PLAUSIBILITY,
    RESIDUAL,
    Square,
    orbit_rows,
    rings_around,
)
from mocoflow_core.methods.scored_views import Subject
from mocoflow_core.metrics.orbit_agreement import residuals_mm, triangulate
from mocoflow_core.metrics.person_judge import PersonJudge, PersonScoreConfig
from mocoflow_core.perception.person import Boxes, Keypoints

CONFIGURATION = PersonScoreConfig(orbit_moments=2, orbit_views=4)
POINT = np.array([0.1, -0.05, 0.2])


@pytest.fixture
def camera() -> Camera:
    K = np.array([[200.0, 0, 50], [0, 200.0, 40], [0, 0, 1]])
    return Camera("cam00", 100, 80, K, np.eye(3), np.array([0.0, 0.0, 3.0]))


@pytest.fixture
def meshes() -> MeshSequence:
    corners = np.array([[-0.2, -0.3, -0.2], [0.2, 0.3, 0.2], [0.2, -0.3, 0.0]], np.float32)
    return MeshSequence(np.arange(5), np.stack([corners] * 5), np.array([[0, 1, 2]]))


@pytest.fixture
def rings(camera, meshes):
    return rings_around(camera, np.arange(5), meshes, (0.0, 1.0, 0.0), CONFIGURATION)


class Dot:
    """A renderer of one black square of 20 px around a world point."""

    def render(self, camera: Camera, frame_index: int) -> tuple[np.ndarray, np.ndarray]:
        x, y = camera.project(POINT[None])[0].round().astype(int)
        opacity = np.zeros((camera.height, camera.width), np.float32)
        opacity[y - 10 : y + 10, x - 10 : x + 10] = 1.0
        return np.repeat(1.0 - opacity[..., None], 3, axis=2), opacity


class Nothing:
    """A renderer of white."""

    def render(self, camera: Camera, frame_index: int) -> tuple[np.ndarray, np.ndarray]:
        shape = (camera.height, camera.width)
        return np.ones((*shape, 3), np.float32), np.zeros(shape, np.float32)


class Middles:
    """Finds dark squares, and every keypoint in their middles."""

    name, digest = "middles", "0" * 64

    def boxes(self, images: Sequence[np.ndarray]) -> list[Boxes]:
        return [self._box(image) for image in images]

    def _box(self, image: np.ndarray) -> Boxes:
        y, x = np.nonzero(image[..., 0] < 128)
        corners = [[x.min(), y.min(), x.max() + 1, y.max() + 1]] if len(x) else []
        found = np.array(corners, np.float32).reshape(-1, 4)
        return Boxes(found, np.ones(len(found), np.float32))

    def keypoints(self, images, boxes) -> list[Keypoints]:
        return [
            Keypoints(np.tile(0.5 * (b[:2] + b[2:]), (17, 1)), np.ones(17, np.float32))
            for b in boxes
        ]


def rows_of(rings, renderer):
    judge = PersonJudge(CONFIGURATION, Middles(), Middles())
    square = Square(40, 0.5)
    return orbit_rows(Subject("s", 0), {"m": renderer}, rings, square, CONFIGURATION, judge)


def values(rows, metric: str) -> list[float]:
    return [row.value for row in rows if row.metric == metric]


def test_every_ring_looks_at_the_body_s_middle_from_the_train_camera_on(camera, rings):
    assert [ring.frame_index for ring in rings] == [0, 4]
    assert np.allclose(rings[0].cameras[0].R, camera.R)
    for one in rings[0].cameras:
        assert np.allclose(one.project(np.zeros((1, 3))), camera.project(np.zeros((1, 3))))


def test_one_body_seen_from_all_sides_agrees_to_a_pixel(rings):
    rows = rows_of(rings, Dot())
    assert values(rows, PLAUSIBILITY) == [1.0] * 8
    pixel_mm = 1000 * 3.0 / 200
    assert len(values(rows, RESIDUAL)) == 2
    assert max(values(rows, RESIDUAL)) < pixel_mm
    assert {row.camera for row in rows} == {ORBIT}


def test_nothing_rendered_is_no_person_and_has_no_residual(rings):
    rows = rows_of(rings, Nothing())
    assert values(rows, PLAUSIBILITY) == [0.0] * 8
    assert values(rows, RESIDUAL) == []


def test_triangulation_finds_a_point_again(rings):
    cameras = rings[0].cameras
    places = np.stack([camera.project(POINT[None])[0] for camera in cameras])
    assert np.allclose(triangulate(cameras, places), POINT, atol=1e-9)


def test_a_residual_is_the_millimetres_by_which_the_sights_miss(rings):
    cameras = rings[0].cameras
    poses = [
        Keypoints(np.tile(camera.project(POINT[None])[0], (17, 1)), np.ones(17))
        for camera in cameras
    ]
    assert np.allclose(residuals_mm(cameras, poses, 0.3), 0.0, atol=1e-6)
    off = [
        Keypoints(pose.places + np.array([0.0, (-1.0) ** number]), pose.confidence)
        for number, pose in enumerate(poses)
    ]
    assert np.allclose(residuals_mm(cameras, off, 0.3), 1000 * 3.0 / 200, rtol=0.15)
    assert np.isnan(residuals_mm(cameras, [*off[:2], None, None], 0.3)).all()


def test_sights_that_meet_behind_the_cameras_miss_as_well(rings):
    camera = rings[0].cameras[0]
    beside = [
        replace(camera, t=camera.t + np.array([shift, 0.0, 0.0])) for shift in (-0.1, 0.0, 0.1)
    ]
    apart = [(30.0, 40.0), (50.0, 43.0), (70.0, 40.0)]  # As if the point were behind them.
    poses = [Keypoints(np.tile(place, (17, 1)), np.ones(17)) for place in reversed(apart)]
    meeting = triangulate(beside, np.array(apart[::-1]))
    behind = triangulate(beside, np.array(apart))
    assert beside[1].to_camera(meeting[None])[0, 2] * beside[1].to_camera(behind[None])[0, 2] < 0
    mirrored = [Keypoints(np.tile(place, (17, 1)), np.ones(17)) for place in apart]
    for some in (poses, mirrored):
        assert (residuals_mm(beside, some, 0.3) > 1.0).all()
