"""Turns a TensorFlow.js graph model into one safetensors file: ``python -m`` this module.

Only needed to make the embedded weights again from their published files. The weights keep their
stored float16 values bit for bit; layouts become (N, C, H, W); what comes before the named input
or after the named outputs is left out, because the detectors do it themselves.
"""

from __future__ import annotations

import argparse
import base64
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save_file

from mocoflow_core.io.content_key import digest_file
from mocoflow_core.perception.graph import INPUT, SAME, Graph, Node

PASSED_ON = ("Identity", "Transpose")
CONVOLUTIONS = ("Conv2D", "_FusedConv2D", "FusedDepthwiseConv2dNative", "DepthwiseConv2dNative")
ACTIVATIONS = {"Relu": "relu", "Relu6": "relu6"}


class Converter:
    """Walks back from the outputs and writes down each operation once."""

    def __init__(
        self, model: Mapping[str, Any], values: Mapping[str, NDArray[Any]], start: str
    ) -> None:
        self.nodes: list[dict[str, Any]] = []
        self.weights: dict[str, NDArray[Any]] = {}
        self._given = {node["name"]: node for node in model["modelTopology"]["node"]}
        self._values = values
        # Name and pixels of padding that is still to be applied.
        self._done: dict[str, tuple[str, int]] = {start: (INPUT, 0)}

    def convert(self, name: str) -> tuple[str, int]:
        """Our name of a given tensor, after writing down all that it needs."""
        name = name.split(":")[0]
        if name not in self._done:
            self._done[name] = self._write(self._given[name])
        return self._done[name]

    def _write(self, node: Mapping[str, Any]) -> tuple[str, int]:
        op, takes = node["op"], node["input"]
        source, padding = self.convert(takes[0])
        if op in PASSED_ON:
            return source, padding
        if op in ("Pad", "PadV2"):
            return source, int(self._values[takes[1]].max())
        if op in CONVOLUTIONS:
            return self._convolve(node, source, padding), 0
        if op in ("Add", "AddV2") and takes[1] in self._values:
            self.weights[f"{source}.bias"] = self._values[takes[1]].reshape(-1)
            return source, padding
        if op in ("Add", "AddV2"):
            return self._add("add", source, self.convert(takes[1])[0]), 0
        if op == "ConcatV2":
            return self._add("concatenate", *(self.convert(name)[0] for name in takes[:-1])), 0
        if op == "ResizeBilinear":
            size = [int(value) for value in self._values[takes[1]]]
            return self._add("resize", source, size=size), 0
        if op == "MaxPool":
            kernel, stride = _second(node, "ksize"), _second(node, "strides")
            pool = {"kernel": kernel, "stride": stride, "padding": padding}
            return self._add("max_pool", source, **pool), 0
        if op == "LeakyRelu":
            slope = node["attr"]["alpha"]["f"]
            return self._add("leaky_relu", source, slope=slope), 0
        raise ValueError(f"no conversion of {op}")

    def _convolve(self, node: Mapping[str, Any], source: str, padding: int) -> str:
        kernel = self._values[node["input"][1]]
        depthwise = "Depthwise" in node["op"]
        settings = {
            "kernel": kernel.shape[0],
            "stride": _second(node, "strides"),
            "padding": SAME if _text(node["attr"]["padding"]["s"]) == "SAME" else padding,
            "groups": kernel.shape[2] if depthwise else 1,
        }
        name = self._add("convolve", source, **settings)
        order = (2, 3, 0, 1) if depthwise else (3, 2, 0, 1)
        self.weights[f"{name}.weight"] = np.ascontiguousarray(kernel.transpose(order))
        fused = node["attr"].get("fused_ops", {"list": {"s": []}})["list"]["s"]
        for step in map(_text, fused):
            if step == "BiasAdd":
                self.weights[f"{name}.bias"] = self._values[node["input"][2]]
            else:
                name = self._add(ACTIVATIONS[step], name)
        return name

    def _add(self, op: str, *takes: str, **settings: Any) -> str:  # noqa: ANN401
        name = f"{op}{len(self.nodes)}"
        self.nodes.append(Node(name=name, op=op, takes=takes, **settings).model_dump())
        return name


def read_values(model: Mapping[str, Any], binary: bytes) -> dict[str, NDArray[Any]]:
    """The constants by name, floats as they are stored."""
    values, offset = {}, 0
    for entry in model["weightsManifest"][0]["weights"]:
        stored = np.dtype(entry.get("quantization", entry)["dtype"])
        count = math.prod(entry["shape"])
        values[entry["name"]] = np.frombuffer(binary, stored, count, offset).reshape(entry["shape"])
        offset += count * stored.itemsize
    return values


def convert(json_file: Path, start: str, outputs: list[str], target: Path) -> None:
    """Write the part of the network between ``start`` and ``outputs``."""
    model = json.loads(json_file.read_text())
    binary = json_file.with_suffix(".bin")
    converter = Converter(model, read_values(model, binary.read_bytes()), start)
    ends = tuple(converter.convert(name)[0] for name in outputs)
    graph = Graph(nodes=tuple(Node(**node) for node in converter.nodes), outputs=ends)
    save_file(
        converter.weights,
        target,
        {"graph": graph.model_dump_json(exclude_defaults=True), "source": digest_file(binary)},
    )


def _second(node: Mapping[str, Any], attribute: str) -> int:
    return int(node["attr"][attribute]["list"]["i"][1])


def _text(encoded: str) -> str:
    return base64.b64decode(encoded).decode()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("json_file", type=Path)
    parser.add_argument("target", type=Path)
    parser.add_argument("--start", required=True)
    parser.add_argument("--outputs", nargs="+", required=True)
    asked = parser.parse_args()
    convert(asked.json_file, asked.start, asked.outputs, asked.target)


if __name__ == "__main__":
    main()
