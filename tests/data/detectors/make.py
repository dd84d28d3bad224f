"""Writes the graphs of this folder; needs the package ``onnx``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import NodeProto, TensorProto, ValueInfoProto
from onnx.helper import make_graph, make_model, make_node, make_opsetid, make_tensor_value_info
from onnx.numpy_helper import from_array

FOLDER = Path(__file__).parent
BOXES = np.float32([[10, 10, 30, 50], [40, 10, 60, 50], [0, 0, 64, 64]])
CONSTANTS = {
    "one": np.float32(1),
    "zero": np.int64([0]),
    "the_boxes": BOXES,
    "the_labels": np.int64([1, 1, 2]),
    "shares": np.float32([0.5, 1, 1]),
}
EVERY = [
    make_node("ReduceMean", ["image"], ["brightness"], axes=[0, 1, 2], keepdims=0),
    make_node("Sub", ["one", "brightness"], ["darkness"]),
    make_node("Mul", ["shares", "darkness"], ["scores"]),
    make_node("Identity", ["the_boxes"], ["boxes"]),
    make_node("Identity", ["the_labels"], ["labels"]),
]
MASKS = [
    make_node("ReduceMean", ["image"], ["grey"], axes=[0], keepdims=1),
    make_node("Sub", ["one", "grey"], ["dark_pixels"]),
    make_node("Unsqueeze", ["dark_pixels", "zero"], ["mask"]),
    make_node("Concat", ["mask"] * 3, ["masks"], axis=0),
]
KEYPOINTS = [
    make_node("Identity", ["the_keypoints"], ["keypoints"]),
    make_node("Identity", ["the_points_scores"], ["keypoints_scores"]),
]


def floats(name: str, *shape: str | int) -> ValueInfoProto:
    return make_tensor_value_info(name, TensorProto.FLOAT, list(shape))


def diagonals() -> np.ndarray:
    """Keypoints (3, 17, 3) along the diagonals of the boxes."""
    steps = np.linspace(0, 1, 17)[:, None]
    points = [box[:2] + steps * (box[2:] - box[:2]) for box in BOXES]
    return np.pad(np.stack(points), ((0, 0), (0, 0), (0, 1)), constant_values=1).astype(np.float32)


def write(name: str, nodes: list[NodeProto], outputs: list[ValueInfoProto]) -> None:
    scores = np.tile(np.float32([4] * 9 + [-4] * 8), (3, 1))
    constants = CONSTANTS | {"the_keypoints": diagonals(), "the_points_scores": scores}
    used = {taken for node in [*EVERY, *nodes] for taken in node.input}
    graph = make_graph(
        [*EVERY, *nodes],
        "detector",
        [floats("image", 3, 64, 64)],
        [
            floats("boxes", "n", 4),
            make_tensor_value_info("labels", TensorProto.INT64, ["n"]),
            floats("scores", "n"),
            *outputs,
        ],
        [from_array(np.asarray(array), key) for key, array in constants.items() if key in used],
    )
    model = make_model(graph, opset_imports=[make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, FOLDER / name)


if __name__ == "__main__":
    write("mask.onnx", MASKS, [floats("masks", "n", 1, 64, 64)])
    write(
        "keypoint.onnx",
        KEYPOINTS,
        [floats("keypoints", "n", 17, 3), floats("keypoints_scores", "n", 17)],
    )
