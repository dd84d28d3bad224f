"""Mask R-CNN and Keypoint R-CNN as torchvision exports them to ONNX, run by ONNX Runtime.

OpenCV's own reader of ONNX loads neither.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.perception.instances import OF_KEYPOINT_RCNN, OF_MASK_RCNN, Found
from mocoflow_core.perception.person import Picture

# Ranks of a graph's outputs, in their order, tell which of the two it is.
RANKS = {(2, 1, 1, 4): OF_MASK_RCNN, (2, 1, 1, 3, 2): OF_KEYPOINT_RCNN}
ADVICE = (
    "Export torchvision's model with one picture (3, H, W) as input, H and W dynamic: "
    "docs/networks.md."
)


class OnnxNetwork:
    """One graph on the CPU. A graph is data: nothing but ONNX's own operators is run."""

    def __init__(self, path: Path) -> None:
        """Raises InputError without ONNX Runtime, and for a file that is no such detector."""
        self.file = path.name
        self.digest = digest_file(path)
        self._session = _open(path)
        inputs = self._session.get_inputs()
        ranks = tuple(len(output.shape) for output in self._session.get_outputs())
        if len(inputs) != 1 or len(inputs[0].shape) != 3 or ranks not in RANKS:
            raise InputError(
                f"{path.name} as a Mask R-CNN or Keypoint R-CNN",
                f"inputs {[one.shape for one in inputs]}, outputs of {ranks} axes",
                ADVICE,
            )
        self.gives = RANKS[ranks]
        self._input = inputs[0].name

    def find(self, image: Picture) -> Found:
        """Raises InputError where the graph does not take pictures of this size."""
        picture = np.ascontiguousarray(image.transpose(2, 0, 1), np.float32) / np.float32(255)
        try:
            values = self._session.run(None, {self._input: picture})
        except Exception as error:  # ONNX Runtime's errors have no common base.
            raise InputError(
                f"{self.file} for pictures of {image.shape[1]} x {image.shape[0]}",
                _first_line(error),
                ADVICE,
            ) from error
        return dict(zip(self.gives, values, strict=True))


def _open(path: Path) -> Any:  # noqa: ANN401 - ONNX Runtime is optional.
    try:
        import onnxruntime
    except ImportError as error:
        raise InputError(
            "ONNX Runtime, which runs .onnx files", "none installed", "pip install 'mocoflow[onnx]'"
        ) from error
    options = onnxruntime.SessionOptions()
    # One thread, as everything beside the optimisation.
    options.intra_op_num_threads = 1
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's errors have no common base.
        raise InputError(f"{path.name} as ONNX", _first_line(error), ADVICE) from error


def _first_line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), "")[:200]
