"""Videos as phones write them: turned by a matrix beside the pixels, or at varying times."""

from __future__ import annotations

import struct
from fractions import Fraction

import av
import numpy as np


def write_turned(path, pictures, fps, write):
    """Upright pictures stored lying, with the matrix of a phone that is held upright."""
    write(path, [np.ascontiguousarray(np.rot90(picture)) for picture in pictures], fps)
    path.write_bytes(turned_clockwise(path.read_bytes()))


def turned_clockwise(film: bytes) -> bytes:
    """The file with the track's matrix that phones write when they are held upright."""
    matrix = struct.pack(">9i", 0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30)
    start = film.index(b"tkhd") + 44  # Behind flags, times, number, duration, layer, volume.
    return film[:start] + matrix + film[start + len(matrix) :]


def write_at_times(path, pictures, times_ms):
    """H.264 whose pictures are shown from these times on."""
    with av.open(str(path), mode="w") as container:
        stream = container.add_stream("libx264", rate=30)
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for picture, time_ms in zip(pictures, times_ms, strict=True):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = int(time_ms), Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
