from __future__ import annotations

import numpy as np

from mocoflow_core.metrics.views import draw_views, spread_frames

VIEWS = [(f"cam{camera}", 5 * frame) for camera in range(4) for frame in range(10)]


def test_few_frames_are_all_taken() -> None:
    assert spread_frames(np.array([3, 8, 13]), 5) == [3, 8, 13]


def test_spread_frames_keep_first_and_last_and_even_gaps() -> None:
    frames = spread_frames(np.arange(0, 500, 5), 12)
    assert len(frames) == 12
    assert (frames[0], frames[-1]) == (0, 495)
    assert np.ptp(np.diff(frames)) <= 5


def test_the_draw_is_fixed_by_its_seed() -> None:
    assert draw_views(VIEWS, 6, seed=1) == draw_views(VIEWS, 6, seed=1)
    assert draw_views(VIEWS, 6, seed=1) != draw_views(VIEWS, 6, seed=2)


def test_every_camera_enters_before_one_enters_twice() -> None:
    for seed in range(5):
        cameras = [camera for camera, _ in draw_views(VIEWS, 6, seed)]
        assert len(cameras) == 6
        counts = [cameras.count(f"cam{camera}") for camera in range(4)]
        assert max(counts) - min(counts) <= 1


def test_a_draw_of_more_than_there_is_takes_everything() -> None:
    assert draw_views(VIEWS, 1000, seed=0) == VIEWS
    assert draw_views([], 3, seed=0) == []
