"""Videos that decode to the very pixels that went in."""

from __future__ import annotations

from fractions import Fraction

import av
import numpy as np


def write_lossless(path, frames, fps=24):
    """H.264 in RGB without loss, in whatever container the name ends with."""
    with av.open(str(path), mode="w") as container:
        stream = container.add_stream("libx264rgb", rate=Fraction(fps).limit_denominator(1001))
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "rgb24"
        stream.options = {"qp": "0", "preset": "ultrafast"}
        for image in frames:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
