"""Laws of BlazePose on real pictures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mocoflow_core.perception.blazepose import BlazePose
from mocoflow_core.perception.region import Region
from tests.squat_pictures import MIRRORED, empty_room, squat_landmarks, squat_pictures

PICTURES = squat_pictures()
# Of the person's 450 px.
CLOSE_PX = 5.0


@pytest.fixture(scope="module")
def model():
    return BlazePose()


@pytest.fixture(scope="module")
def boxes(model):
    return [found.corners[0] for found in model.boxes(PICTURES)]


@pytest.fixture(scope="module")
def poses(model, boxes):
    return model.poses(PICTURES, boxes)


def places(poses):
    return np.stack([pose.landmarks.places for pose in poses])


def test_the_one_person_is_found_and_nobody_in_an_empty_room(model):
    found = model.boxes([*PICTURES, empty_room()])
    assert [len(boxes.corners) for boxes in found] == [1, 1, 1, 0]
    assert all(boxes.confidence[0] > 0.9 for boxes in found[:3])


def test_landmarks_are_those_of_the_original_runtime(poses):
    apart = np.linalg.norm(places(poses) - squat_landmarks(), axis=-1)
    assert np.median(apart) < CLOSE_PX
    assert np.quantile(apart, 0.95) < 4 * CLOSE_PX


def test_nobody_is_present_where_nobody_is(model, boxes, poses):
    assert min(pose.presence for pose in poses) > 0.9
    assert model.keypoints([empty_room()], boxes[:1]) == [None]


def test_a_mirrored_picture_has_the_mirrored_landmarks(model, boxes, poses):
    width = PICTURES[0].shape[1]
    mirrored = [np.ascontiguousarray(picture[:, ::-1]) for picture in PICTURES]
    flipped = [(width - box[2], box[1], width - box[0], box[3]) for box in boxes]
    found = places(model.poses(mirrored, np.float32(flipped)))[:, MIRRORED]
    off = found[..., 0] + places(poses)[..., 0] - width
    assert abs(np.median(off)) < 1.0  # No half pixel of the network's is lost on the way.


def test_world_landmarks_stand_upright_in_metres_left_of_the_body_to_the_right(poses):
    for pose in poses:
        world = pose.landmarks.world
        head, ankles, hips = world[0], world[[27, 28]].mean(0), world[[23, 24]]
        assert 0.7 < ankles[1] - head[1] < 1.9
        assert np.abs(hips.mean(0)).max() < 0.05
        assert hips[0, 0] > hips[1, 0]


def test_the_mask_holds_the_body_and_not_the_room(poses):
    height, width = PICTURES[0].shape[:2]
    for pose in poses:
        mask = pose.mask(height, width) > 0.5
        columns, rows = pose.keypoints.places[5:].astype(int).T
        assert mask[rows, columns].mean() > 0.8
        assert 0.05 < mask.mean() < 0.3
        assert not mask[:, -50:].any()


def test_the_person_is_found_again_where_the_pose_says(model, poses):
    again = model.landmarks.poses(PICTURES, [pose.next_region for pose in poses])
    apart = np.linalg.norm(places(again) - places(poses), axis=-1)
    assert np.median(apart) < CLOSE_PX


def test_a_region_goes_into_the_picture_and_back():
    picture = np.zeros((80, 120, 3), np.uint8)
    cv2.circle(picture, (70, 30), 6, (255, 255, 255), -1)
    region = Region((66.0, 34.0), 48.0, 0.6)
    cut = region.cut(picture, 96)
    rows, columns = np.nonzero(cut[..., 0] > 127)
    inside = np.array([[columns.mean() + 0.5, rows.mean() + 0.5]]) / 96
    assert region.places(inside)[0] == pytest.approx((70.5, 30.5), abs=0.3)
    back = region.laid_back(cut[..., 0].astype(np.float32) / 255, 80, 120) > 0.5
    assert (back != (picture[..., 0] > 127)).sum() < 20
