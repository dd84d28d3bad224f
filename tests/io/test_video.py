"""Laws of reading and writing video."""

from __future__ import annotations

import av
import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.io.video import decode_to_the_end, describe_video, read_frames, write_video
from tests.lossless_video import write_lossless


def numbered(count=12, height=32, width=48):
    """Frames that show their number as brightness."""
    return [np.full((height, width, 3), 20 + 15 * number, np.uint8) for number in range(count)]


@pytest.fixture
def video(tmp_path):
    path = tmp_path / "numbers.mp4"
    write_video(path, numbered(), 30)
    return path


def test_wanted_frames_come_by_their_number(video):
    read = dict(read_frames(video, {1, 7, 11}))
    assert sorted(read) == [1, 7, 11]
    for number, image in read.items():
        assert abs(int(image.mean()) - (20 + 15 * number)) <= 3


def test_a_video_says_its_rate_and_its_number_of_frames(video):
    description = describe_video(video)
    assert description.frame_count == 12
    assert description.fps == pytest.approx(30)


def test_videos_are_what_browsers_play(video):
    with av.open(str(video)) as container:
        context = container.streams.video[0].codec_context
        assert (context.name, context.pix_fmt) == ("h264", "yuv420p")


def test_odd_sizes_are_padded_by_one_pixel(tmp_path):
    path = tmp_path / "odd.mp4"
    write_video(path, numbered(3, 31, 47), 12)
    [(_, image)] = read_frames(path, {0})
    assert image.shape == (32, 48, 3)


def test_colours_survive(tmp_path):
    path = tmp_path / "red.mp4"
    red = np.full((32, 32, 3), [200, 30, 60], np.uint8)
    write_video(path, [red] * 3, 12)
    [(_, image)] = read_frames(path, {1})
    assert np.abs(image.astype(int) - red).max() <= 6


def test_a_file_that_is_no_video_is_refused(tmp_path):
    path = tmp_path / "no.mp4"
    path.write_bytes(b"plain text")
    for use in (describe_video, lambda file: list(read_frames(file, {0}))):
        with pytest.raises(InputError, match=r"no\.mp4"):
            use(path)


def test_a_truncated_video_is_refused(video):
    whole = video.read_bytes()
    video.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"numbers\.mp4"):
        list(read_frames(video, {0, 11}))


def test_a_frame_beyond_the_end_is_refused(video):
    with pytest.raises(InputError, match="no frame 12"):
        list(read_frames(video, {3, 12}))


def test_a_video_needs_a_frame(tmp_path):
    with pytest.raises(ValueError, match="at least one frame"):
        write_video(tmp_path / "empty.mp4", [], 12)


def test_frames_are_counted_by_decoding_where_the_container_says_more(tmp_path):
    path = tmp_path / "cut.avi"
    noise = np.random.default_rng(0).integers(0, 255, (12, 32, 48, 3), np.uint8)
    write_lossless(path, noise)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 6 // 10])
    with av.open(str(path)) as container:
        assert container.streams.video[0].frames == 12
    decoded = decode_to_the_end(path)
    assert decoded.frame_count == 7
    assert (decoded.width, decoded.height) == (48, 32)
    assert len(list(read_frames(path, range(7)))) == 7


def test_a_video_that_breaks_off_inside_a_frame_is_refused(tmp_path, video):
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(video.read_bytes()[:-200])
    with pytest.raises(InputError, match="must be a video"):
        decode_to_the_end(broken)
