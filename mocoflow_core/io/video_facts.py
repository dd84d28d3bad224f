"""What a video file says of itself: when its frames are shown, and what the camera wrote down."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.io.video import undecodable, video_stream


@dataclass(frozen=True, eq=False)
class VideoFacts:
    """Nothing is decoded for these."""

    times_s: NDArray[np.float64]  # (N,) of the frames in the order they are shown, from 0
    metadata: dict[str, str]  # of the file and of its stream, keys in lower case


def read_video_facts(path: Path) -> VideoFacts:
    """Time stamps and metadata. Raises InputError when the file is no video."""
    try:
        with av.open(str(path)) as container:
            stream = video_stream(container, path)
            metadata = {key.lower(): value for key, value in container.metadata.items()}
            metadata |= {key.lower(): value for key, value in stream.metadata.items()}
            stamps = [packet.pts for packet in container.demux(stream) if packet.size]
            rate, base = stream.average_rate, stream.time_base
    except av.FFmpegError as error:
        raise undecodable(path, error.strerror or str(error)) from error
    if not stamps:
        raise undecodable(path, "no frame")
    if any(stamp is None for stamp in stamps) or base is None:
        return VideoFacts(np.arange(len(stamps)) / float(rate or 25), metadata)
    times = np.sort(np.array(stamps, np.float64)) * float(base)
    return VideoFacts(times - times[0], metadata)
