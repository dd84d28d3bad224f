"""Video files: frames read exactly by number, and H.264 written for browsers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.whole_file import whole_file

Image = NDArray[np.uint8]  # (H, W, 3) sRGB-encoded


@dataclass(frozen=True)
class VideoDescription:
    """What the container says about its first video stream."""

    fps: float
    frame_count: int  # packets in the stream; a damaged file may decode to fewer


@dataclass(frozen=True)
class DecodedVideo:
    """What decoding to the end finds."""

    frame_count: int
    width: int  # of the upright picture
    height: int


def describe_video(path: Path) -> VideoDescription:
    """Rate and number of frames, without decoding.

    Raises InputError when the file is no video.
    """
    try:
        with av.open(str(path)) as container:
            stream = video_stream(container, path)
            count = sum(1 for packet in container.demux(stream) if packet.size)
            return VideoDescription(float(stream.average_rate or 0.0), count)
    except av.FFmpegError as error:
        raise undecodable(path, error.strerror or str(error)) from error


def decode_to_the_end(path: Path) -> DecodedVideo:
    """Count the frames that decode, where a container's own count cannot be relied on.

    Raises InputError when the file is no video, holds no frame, or is damaged on the way.
    """
    count, width, height = 0, 0, 0
    try:
        with av.open(str(path)) as container:
            for frame in container.decode(video_stream(container, path)):
                if not count:
                    height, width = _upright(frame).shape[:2]
                count += 1
    except av.FFmpegError as error:
        raise undecodable(path, error.strerror or str(error)) from error
    if not count:
        raise undecodable(path, "no frame")
    return DecodedVideo(count, width, height)


def read_frames(path: Path, wanted: Collection[int]) -> Iterator[tuple[int, Image]]:
    """Decode from the start and yield ``(number, rgb)`` of the wanted frames, ascending.

    Counting decoded frames is exact where seeking by time stamps is not. Only one frame is held.
    Raises InputError when the file cannot be decoded up to the last wanted frame.
    """
    remaining = set(wanted)
    try:
        with av.open(str(path)) as container:
            stream = video_stream(container, path)
            for number, frame in enumerate(container.decode(stream)):
                if number in remaining:
                    remaining.discard(number)
                    yield number, _upright(frame)
                if not remaining:
                    return
    except av.FFmpegError as error:
        raise undecodable(path, error.strerror or str(error)) from error
    if remaining:
        raise undecodable(path, f"no frame {min(remaining)}")


def write_video(path: Path, frames: Iterable[Image], fps: float) -> None:
    """Write H.264 in yuv420p, which every browser plays. Odd sizes are padded by one pixel.

    The file appears complete or not at all.
    """
    with whole_file(path) as beside, av.open(str(beside), mode="w") as container:
        stream = None
        for image in frames:
            even = np.pad(image, ((0, image.shape[0] % 2), (0, image.shape[1] % 2), (0, 0)), "edge")
            if stream is None:
                stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
                stream.height, stream.width = even.shape[:2]
                stream.pix_fmt = "yuv420p"
                stream.options = {"crf": "18"}
            container.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        if stream is None:
            raise ValueError("a video needs at least one frame, got none")
        container.mux(stream.encode(None))


def video_stream(container: av.container.InputContainer, path: Path) -> av.VideoStream:
    if not container.streams.video:
        raise undecodable(path, "no video stream")
    return container.streams.video[0]


def _upright(frame: av.VideoFrame) -> Image:
    """The picture as a player shows it: phones store a rotation beside the pixels."""
    return np.rot90(frame.to_ndarray(format="rgb24"), k=round(frame.rotation / 90))


def undecodable(path: Path, found: str) -> InputError:
    return InputError(
        f"{path.name} must be a video that can be decoded",
        found,
        "Re-encode it, for example with ffmpeg to H.264, or give frames as PNG files.",
    )
