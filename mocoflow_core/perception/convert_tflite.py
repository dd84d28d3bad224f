"""Turns a TensorFlow Lite model into one safetensors file: ``python -m`` this module.

Only needed to make the embedded weights of BlazePose again from their published files; wants the
packages ``tflite`` and, to compare the result with the original runtime, ``ai-edge-litert``.
Half-precision weights keep their values bit for bit, sparse ones are spread out; kernels with more
than ``LARGE`` weights become bytes with a scale for each channel, which moves landmarks by 0.02 px
in the median of real pictures; heads, which are smaller, would move them by 10. Layouts become
(N, C, H, W).
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import tflite
import torch
from ai_edge_litert.interpreter import Interpreter
from numpy.typing import NDArray
from safetensors.numpy import save_file

from mocoflow_core.io.content_key import digest_file
from mocoflow_core.perception.embedded import graph_network, read_weights
from mocoflow_core.perception.graph import INPUT, SAME, Graph, Node

LARGE = 400_000
TYPES = {0: np.float32, 1: np.float16, 2: np.int32}
VECTORS = {1: tflite.Int32Vector, 2: tflite.Uint16Vector, 3: tflite.Uint8Vector}
PADDED_TO_SAME, RELU6 = 0, 3
PASSED_ON = ("DEQUANTIZE", "DENSIFY", "RESHAPE")
OPTIONS = {
    "CONV_2D": tflite.Conv2DOptions,
    "DEPTHWISE_CONV_2D": tflite.DepthwiseConv2DOptions,
    "ADD": tflite.AddOptions,
}


class Source:
    """The one graph of a flatbuffer."""

    def __init__(self, file: Path) -> None:
        self._model = tflite.Model.GetRootAs(file.read_bytes(), 0)
        self._graph = self._model.Subgraphs(0)
        self.start = int(self._graph.Inputs(0))
        self.ends = [int(tensor) for tensor in self._graph.OutputsAsNumpy()]

    def shape(self, tensor: int) -> tuple[int, ...]:
        return tuple(int(size) for size in self._graph.Tensors(tensor).ShapeAsNumpy())

    def constant(self, tensor: int) -> NDArray[Any]:
        described = self._graph.Tensors(tensor)
        stored = self._model.Buffers(described.Buffer()).DataAsNumpy()
        values = stored.view(TYPES[described.Type()])
        if described.Sparsity() is None:
            return values.reshape(self.shape(tensor))
        return _spread(described.Sparsity().DimMetadata(3), values, self.shape(tensor))

    def operations(self) -> list[tuple[str, Any, list[int], int]]:
        """Name, options, operands and result of every operation."""
        listed = []
        for place in range(self._graph.OperatorsLength()):
            operator = self._graph.Operators(place)
            code = self._model.OperatorCodes(operator.OpcodeIndex())
            name = tflite.opcode2name(max(code.BuiltinCode(), code.DeprecatedBuiltinCode()))
            options = OPTIONS.get(name)
            chosen = options and _table(options, operator.BuiltinOptions())
            operands = [int(tensor) for tensor in operator.InputsAsNumpy()]
            listed.append((name, chosen, operands, int(operator.Outputs(0))))
        return listed


class Converter:
    """Walks through the operations once and writes down ours."""

    def __init__(self, source: Source) -> None:
        self.nodes: list[Node] = []
        self.weights: dict[str, NDArray[Any]] = {}
        self._source = source
        self._names = {source.start: INPUT}
        self._same_as: dict[int, int] = {}
        self._padded: dict[int, tuple[int, int]] = {}  # origin and pixels on every side
        self._joined: dict[int, list[int]] = {}
        for operation in source.operations():
            self._write(*operation)

    def ends(self) -> tuple[str, ...]:
        """Our names of the outputs; several for one that is joined of several grids."""
        parts = [part for end in self._source.ends for part in self._joined.get(end, [end])]
        return tuple(self._names[self._origin(part)] for part in parts)

    def _write(self, op: str, chosen: Any, takes: list[int], result: int) -> None:  # noqa: ANN401
        if op in PASSED_ON:
            self._same_as[result] = takes[0]
        elif op == "CONCATENATION":
            self._joined[result] = takes
        elif op == "PAD":
            self._pad(takes, result)
        elif op in ("CONV_2D", "DEPTHWISE_CONV_2D"):
            self._convolve(op == "DEPTHWISE_CONV_2D", chosen, takes, result)
        elif op == "ADD":
            self._add("add", takes, result)
            self._activate(chosen, result)
        elif op == "MAX_POOL_2D":
            self._add("max_pool", takes, result, kernel=2, stride=2)
        elif op == "RESIZE_BILINEAR":
            self._add("resize", takes[:1], result, size=self._source.shape(result)[1:3])
        elif op in ("DEPTH_TO_SPACE", "LOGISTIC"):
            self._add({"LOGISTIC": "sigmoid"}.get(op, "depth_to_space"), takes, result)
        else:
            raise ValueError(f"no conversion of {op}")

    def _pad(self, takes: list[int], result: int) -> None:
        _, (pixels, _), _, (_, channels) = self._constant(takes[1]).tolist()
        if channels:
            self._add("widen", takes[:1], result, channels=channels)
        else:
            self._padded[result] = takes[0], pixels

    def _convolve(self, depthwise: bool, chosen: Any, takes: list[int], result: int) -> None:  # noqa: ANN401
        order = (3, 0, 1, 2) if depthwise else (0, 3, 1, 2)
        kernel = np.ascontiguousarray(self._constant(takes[1]).transpose(order))
        origin, pixels = self._padded.get(takes[0], (takes[0], 0))
        settings = {
            "kernel": kernel.shape[-1],
            "stride": chosen.StrideH(),
            "padding": SAME if chosen.Padding() == PADDED_TO_SAME else pixels,
            "groups": len(kernel) if depthwise else 1,
        }
        name = self._add("convolve", [origin], result, **settings)
        self.weights[f"{name}.bias"] = self._constant(takes[2]).copy()
        if kernel.size > LARGE:
            self.weights[f"{name}.weight"], self.weights[f"{name}.scale"] = _as_bytes(kernel)
        else:
            self.weights[f"{name}.weight"] = kernel
        self._activate(chosen, result)

    def _activate(self, chosen: Any, result: int) -> None:  # noqa: ANN401
        if activation := chosen.FusedActivationFunction():
            assert activation == RELU6, activation
            self._add("relu6", [result], result)

    def _add(self, op: str, takes: list[int], result: int, **settings: Any) -> str:  # noqa: ANN401
        name = f"{op}{len(self.nodes)}"
        given = tuple(self._names[tensor] for tensor in takes)
        self.nodes.append(Node(name=name, op=op, takes=given, **settings))
        self._names[result] = name
        return name

    def _constant(self, tensor: int) -> NDArray[Any]:
        return self._source.constant(self._origin(tensor))

    def _origin(self, tensor: int) -> int:
        while tensor in self._same_as:
            tensor = self._same_as[tensor]
        return tensor


def convert(source: Path, target: Path) -> None:
    converter = Converter(Source(source))
    graph = Graph(nodes=tuple(converter.nodes), outputs=converter.ends())
    described = graph.model_dump_json(exclude_defaults=True)
    save_file(converter.weights, target, {"graph": described, "source": digest_file(source)})


def disagreement(source: Path, converted: Path) -> list[float]:
    """Largest difference of every output to the source's runtime, as a share of its spread."""
    interpreter = Interpreter(model_path=str(source), num_threads=1)
    interpreter.allocate_tensors()
    (wanted,) = interpreter.get_input_details()
    picture = np.random.default_rng(0).uniform(0, 1, wanted["shape"]).astype(np.float32)
    interpreter.set_tensor(wanted["index"], picture)
    interpreter.invoke()
    network = graph_network(read_weights(converted))
    found = iter(network(torch.from_numpy(picture.transpose(0, 3, 1, 2))))
    differences = []
    for detail in interpreter.get_output_details():
        expected = interpreter.get_tensor(detail["index"]).ravel()
        got = np.zeros(0, np.float32)
        while got.size < expected.size:
            got = np.append(got, next(found).permute(0, 2, 3, 1).numpy())
        differences.append(float(np.abs(got - expected).max() / max(np.ptp(expected), 1e-9)))
    return differences


def _table(kind: type, table: Any) -> Any:  # noqa: ANN401
    typed = kind()
    typed.Init(table.Bytes, table.Pos)
    return typed


def _spread(last: Any, values: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:  # noqa: ANN401
    """Rows of the last axis, which are stored as positions and values."""
    ends = _table(VECTORS[last.ArraySegmentsType()], last.ArraySegments()).ValuesAsNumpy()
    positions = _table(VECTORS[last.ArrayIndicesType()], last.ArrayIndices()).ValuesAsNumpy()
    rows = np.zeros((int(np.prod(shape[:-1])), shape[-1]), values.dtype)
    rows[np.repeat(np.arange(len(rows)), np.diff(ends.astype(np.int64))), positions] = values
    return rows.reshape(shape)


def _as_bytes(kernel: NDArray[Any]) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """The kernel (out, in, h, w) in steps of a scale (out, 1, 1, 1)."""
    exact = kernel.astype(np.float32)
    scale = np.abs(exact).max(axis=(1, 2, 3), keepdims=True) / 127
    scale[scale == 0] = 1
    return np.round(exact / scale).astype(np.int8), scale


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    asked = parser.parse_args()
    convert(asked.source, asked.target)
    print(digest_file(asked.target), disagreement(asked.source, asked.target))


if __name__ == "__main__":
    main()
