from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.oks import SIGMAS, centred_oks, oks
from mocoflow_core.perception.person import COCO17, Keypoints

AREA = 2000.0
EVERY = np.ones(17, bool)


@pytest.fixture
def pose() -> Keypoints:
    places = np.random.default_rng(0).uniform(0, 100, (17, 2)).astype(np.float32)
    return Keypoints(places, np.full(17, 0.9, np.float32))


def test_a_pose_is_like_itself_wherever_it_stands(pose):
    moved = Keypoints(pose.places + np.array([30.0, -12.0], np.float32), pose.confidence)
    assert centred_oks(pose, pose, AREA, 0.3) == 1.0
    assert centred_oks(moved, pose, AREA, 0.3) == pytest.approx(1.0, abs=1e-5)


def test_one_point_off_by_a_known_distance_scores_coco_s_formula(pose):
    places = pose.places.copy()
    places[9, 0] += 8.0  # left wrist
    expected = (16 + np.exp(-(8.0**2) / (2 * AREA * (2 * 0.062) ** 2))) / 17
    assert oks(places, pose.places, AREA, EVERY) == pytest.approx(expected)
    assert SIGMAS[COCO17.index("left_wrist")] == 0.062


def test_points_doubtful_in_the_reference_move_neither_the_score_nor_the_mean(pose):
    confidence = pose.confidence.copy()
    confidence[3] = 0.1
    reference = Keypoints(pose.places, confidence)
    places = pose.places.copy()
    places[3] = 1e4
    assert centred_oks(Keypoints(places, pose.confidence), reference, AREA, 0.3) == 1.0


def test_points_doubtful_in_the_render_alone_still_count(pose):
    places = pose.places.copy()
    places[3] += 500.0
    doubtful = Keypoints(places, np.full(17, 0.01, np.float32))
    assert centred_oks(doubtful, pose, AREA, 0.3) < 0.99


def test_a_reference_without_a_confident_point_gives_no_number(pose):
    nothing = Keypoints(pose.places, np.zeros(17, np.float32))
    assert np.isnan(centred_oks(pose, nothing, AREA, 0.3))
