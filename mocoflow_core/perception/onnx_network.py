"""Mask R-CNN and Keypoint R-CNN as torchvision exports them to ONNX, run by ONNX Runtime.

OpenCV's own reader of ONNX loads neither. An export holds for pictures of the size that it was made
with and is silently wrong for others: pictures are scaled into that size, and what is found back.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.perception.instances import (
    BOXES,
    KEYPOINTS,
    MASKS,
    OF_KEYPOINT_RCNN,
    OF_MASK_RCNN,
    Found,
)
from mocoflow_core.perception.person import Picture

# Ranks of a graph's outputs, in their order, tell which of the two it is.
RANKS = {(2, 1, 1, 4): OF_MASK_RCNN, (2, 1, 1, 3, 2): OF_KEYPOINT_RCNN}
ADVICE = "Export torchvision's model with one picture of fixed size as input: docs/networks.md."
# ImageNet's mean, which is nothing to these networks.
AROUND = (124, 116, 104)


class OnnxNetwork:
    """One graph on the CPU. A graph is data: nothing but ONNX's own operators is run."""

    def __init__(self, path: Path) -> None:
        """Raises InputError without ONNX Runtime, and for a file that is no such detector."""
        self.file = path.name
        self.digest = digest_file(path)
        self._session = _open(path)
        shapes = [one.shape for one in self._session.get_inputs()]
        ranks = tuple(len(output.shape) for output in self._session.get_outputs())
        if [len(shape) for shape in shapes] != [3] or ranks not in RANKS:
            raise InputError(
                f"{path.name} as a Mask R-CNN or Keypoint R-CNN",
                f"inputs {shapes}, outputs of {ranks} axes",
                ADVICE,
            )
        if not all(isinstance(side, int) for side in shapes[0]):
            raise InputError(
                f"{path.name} with an input of fixed size, for which alone such an export holds",
                f"{shapes[0]}",
                ADVICE,
            )
        self.gives = RANKS[ranks]
        self._input = self._session.get_inputs()[0].name
        self._size = (int(shapes[0][1]), int(shapes[0][2]))

    def find(self, image: Picture) -> Found:
        """Raises InputError where the graph does not run."""
        fitted = _fitted(image, self._size)
        planes = np.ascontiguousarray(fitted.picture.transpose(2, 0, 1), np.float32)
        try:
            values = self._session.run(None, {self._input: planes / np.float32(255)})
        except Exception as error:  # ONNX Runtime's errors have no common base.
            raise InputError(f"{self.file} that runs", _first_line(error), ADVICE) from error
        return _put_back(dict(zip(self.gives, values, strict=True)), fitted, image.shape[:2])


class _Fitted(NamedTuple):
    """A picture in the upper left of another one."""

    picture: Picture
    inside: tuple[int, int]  # height and width of what is the picture
    scale: NDArray[np.float32]  # (2,) x and y, pixels of it for one of the original


def _fitted(image: Picture, size: tuple[int, int]) -> _Fitted:
    height, width = image.shape[:2]
    factor = min(size[0] / height, size[1] / width)
    inside = (max(round(factor * height), 1), max(round(factor * width), 1))
    how = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    picture = np.full((*size, 3), AROUND, np.uint8)
    picture[: inside[0], : inside[1]] = cv2.resize(image, inside[::-1], interpolation=how)
    return _Fitted(picture, inside, np.array([inside[1] / width, inside[0] / height], np.float32))


def _put_back(found: Found, fitted: _Fitted, size: tuple[int, int]) -> Found:
    """What was found in a fitted picture as it lies in the original (H, W)."""
    placed = dict(found)
    corners = found[BOXES].reshape(-1, 2, 2) / fitted.scale
    placed[BOXES] = np.clip(corners, 0, [size[1], size[0]]).reshape(-1, 4)
    if KEYPOINTS in found:
        points = found[KEYPOINTS].copy()
        # COCO counts the middle of the first pixel as 0.
        points[..., :2] = (points[..., :2] + 0.5) / fitted.scale - 0.5
        placed[KEYPOINTS] = points
    if MASKS in found:
        inside = found[MASKS][:, 0, : fitted.inside[0], : fitted.inside[1]]
        back = [cv2.resize(mask, size[::-1], interpolation=cv2.INTER_LINEAR) for mask in inside]
        placed[MASKS] = np.array(back, np.float32).reshape(-1, 1, *size)
    return placed


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
