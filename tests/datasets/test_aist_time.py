"""The 60 Hz grid of AIST++ against videos of about that rate."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.datasets.aist_time import GridFrames, shown_frames, ticks_of
from mocoflow_core.io.video import VideoDescription, write_video

NTSC = 60000 / 1001


def resampled(count, fps, rounding):
    """What ffmpeg's fps filter does, frame by frame: a frame stays until a later one comes due."""
    round_tick = np.floor if rounding == "down" else np.ceil
    due = [int(round_tick(np.round(60 * frame / fps, 9))) for frame in range(count)]
    return [max(frame for frame in range(count) if due[frame] <= tick) for tick in range(max(due))]


@pytest.mark.parametrize("rounding", ["down", "up"])
@pytest.mark.parametrize("fps", [NTSC, 60.0, 30.0, 61.3])
def test_ticks_show_what_ffmpegs_fps_filter_shows(fps, rounding):
    wanted = resampled(1500, fps, rounding)
    ticks = np.arange(len(wanted), dtype=np.int32)
    np.testing.assert_array_equal(shown_frames(ticks, fps, rounding), wanted)


@pytest.mark.parametrize("fps", [60.0, 60.0 * (1 - 2e-5), 60.0 * (1 + 2e-5)])
def test_frames_of_60_hertz_videos_are_the_ticks_however_the_container_rounds(fps):
    ticks = np.arange(3000, dtype=np.int32)
    for rounding in ("down", "up"):
        np.testing.assert_array_equal(shown_frames(ticks, fps, rounding), ticks)


def test_raw_frame_numbers_would_drift_by_one_in_17_seconds():
    ticks = np.array([0, 16 * 60, 17 * 60], np.int32)
    assert (ticks - shown_frames(ticks, NTSC, "down")).tolist() == [0, 0, 1]


def test_rounding_up_shows_the_frame_before():
    ticks = np.arange(1, 900, dtype=np.int32)
    apart = shown_frames(ticks, NTSC, "down") - shown_frames(ticks, NTSC, "up")
    assert set(apart.tolist()) == {1}


@pytest.mark.parametrize(("fps", "count"), [(60.0, 10), (NTSC, 1002)])
def test_every_tick_of_a_video_has_a_frame(fps, count):
    ticks = ticks_of(VideoDescription(fps, count), "down")
    shown = shown_frames(ticks, fps, "down")
    assert (shown[0], shown[-1]) == (0, count - 1)


def test_frames_come_by_tick_and_repeat_where_the_video_is_slower(tmp_path):
    grey = [np.full((32, 32, 3), 40 + 20 * number, np.uint8) for number in range(8)]
    write_video(tmp_path / "half.mp4", grey, 30)
    frames = GridFrames(tmp_path / "half.mp4", np.arange(3, 8, dtype=np.int32))
    assert frames.shown([3, 4, 5]) == {3: 1, 4: 2, 5: 2}
    read = {tick: int(image.mean()) for tick, image in frames.read([3, 4, 5, 7])}
    assert read == pytest.approx({3: 60, 4: 80, 5: 80, 7: 100}, abs=4)
    assert frames.fps == 60
