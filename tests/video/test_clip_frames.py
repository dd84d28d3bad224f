"""Laws of the frames that are taken from a video."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.io.video import write_video
from mocoflow_core.io.video_facts import VideoFacts, read_video_facts
from mocoflow_core.video.clip_frames import choose_frames
from mocoflow_core.video.configuration import VideoConfig
from tests.phone_video import turned_clockwise

PATH = Path("phone.mp4")


def steady(seconds, rate):
    return VideoFacts(np.arange(round(seconds * rate)) / rate, {})


def test_every_frame_of_a_usual_video_is_taken_under_its_own_number():
    frames, said = choose_frames(PATH, steady(4, 30), VideoConfig(start_s=1, end_s=2))
    assert frames.indices.tolist() == frames.numbers.tolist() == list(range(30, 61))
    assert frames.rate == pytest.approx(30)
    assert "31 frames, 30 per second" in said


@pytest.mark.parametrize(("rate", "stride"), [(60, 2), (59.94, 2), (240, 8), (50, 2), (29.97, 1)])
def test_a_fast_video_is_thinned_out_evenly(rate, stride):
    frames, said = choose_frames(PATH, steady(2, rate), VideoConfig())
    assert np.diff(frames.numbers).tolist() == [stride] * (len(frames.numbers) - 1)
    assert frames.rate == pytest.approx(rate / stride)
    assert (f"one in {stride}" in said) == (stride > 1)


def test_a_varying_rate_becomes_even_times():
    times = np.cumsum(np.tile([0.033, 0.033, 0.034, 0.1], 30))
    frames, said = choose_frames(PATH, VideoFacts(times - times[0], {}), VideoConfig())
    assert frames.indices.tolist() == list(range(len(frames.indices)))
    taken = (times - times[0])[frames.numbers]
    assert np.abs(taken - frames.indices / frames.rate).max() <= 0.051
    assert "varies (10 to 30.3 per second)" in said


def test_frames_of_a_varying_rate_are_the_nearest_ones():
    times = np.cumsum(np.random.default_rng(0).choice([0.01, 0.03, 0.08], 300))
    times -= times[0]
    frames, _ = choose_frames(PATH, VideoFacts(times, {}), VideoConfig(fps=20))
    wanted = np.arange(len(frames.numbers)) / frames.rate
    off = np.abs(times[frames.numbers] - wanted)
    assert off == pytest.approx(np.abs(times[None] - wanted[:, None]).min(1))


def test_stamps_rounded_to_milliseconds_are_a_constant_rate():
    times = np.round(np.arange(90) / 29.97, 3)
    frames, _ = choose_frames(PATH, VideoFacts(times, {}), VideoConfig())
    assert frames.rate == pytest.approx(29.97, rel=1e-3)
    assert frames.numbers.tolist() == list(range(90))


@pytest.mark.parametrize(
    ("seconds", "said", "line"),
    [
        (600, {}, "at most 60 s, got 600 s. Choose a part of the video: --clip"),
        (4, {"start_s": 9.0}, "within the video's 4.0 s"),
        (4, {"start_s": 2.0, "end_s": 2.1}, "at least 10 frames, got 4"),
        (2 / 30, {}, "at least 10 frames, got 2"),
        (1 / 30, {}, "got the still picture phone.mp4"),
    ],
)
def test_what_is_no_clip_is_refused_with_a_reason(seconds, said, line):
    with pytest.raises(InputError) as refused:
        choose_frames(PATH, steady(seconds, 30), VideoConfig(**said))
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)


def test_frames_come_smaller_and_repeatedly_where_the_video_stood_still(tmp_path):
    pictures = [np.full((96, 64, 3), 10 * number, np.uint8) for number in range(14)]
    write_video(tmp_path / "small.mp4", pictures, 10)
    facts = read_video_facts(tmp_path / "small.mp4")
    assert facts.times_s == pytest.approx(np.arange(14) / 10)
    facts.times_s[7:] += 0.3
    configuration = VideoConfig(max_side=64)
    frames, _ = choose_frames(tmp_path / "small.mp4", facts, configuration)
    assert frames.video_size == (64, 96)
    assert frames.size == (43, 64)
    read = dict(frames.read(frames.indices.tolist()))
    assert list(read) == frames.indices.tolist()
    for index, number in zip(frames.indices.tolist(), frames.numbers.tolist(), strict=True):
        assert read[index].shape == (64, 43, 3)
        assert abs(float(read[index].mean()) - 10 * number) < 4
    assert len(set(frames.numbers.tolist())) < len(frames.numbers)
    later = frames.part(5, 9)
    assert later.indices.tolist() == frames.indices[5:10].tolist()


def test_a_portrait_video_stands_upright(tmp_path):
    pictures = [np.zeros((64, 96, 3), np.uint8) for _ in range(10)]
    for picture in pictures:
        picture[:16, :16] = 255  # Top left as stored, top right as shown.
    path = tmp_path / "portrait.mp4"
    write_video(path, pictures, 10)
    path.write_bytes(turned_clockwise(path.read_bytes()))
    frames, _ = choose_frames(path, read_video_facts(path), VideoConfig())
    assert frames.video_size == frames.size == (64, 96)
    ((_, shown),) = frames.read([3])
    assert shown[:16, -16:].mean() > 200
    assert shown[:16, :16].mean() < 50
