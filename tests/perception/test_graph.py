from __future__ import annotations

import numpy as np
import pytest
import torch
from safetensors.numpy import save_file

from mocoflow_core.errors import InputError
from mocoflow_core.perception.convert_tfjs import Converter
from mocoflow_core.perception.embedded import (
    DIGESTS,
    FOLDER,
    embedded_weights,
    graph_network,
    read_weights,
)
from mocoflow_core.perception.graph import SAME, Graph, GraphNetwork, Node


def picture(size: int = 8) -> torch.Tensor:
    return torch.arange(size * size, dtype=torch.float32).view(1, 1, size, size)


def test_padding_to_the_same_size_puts_the_odd_pixel_at_the_far_end():
    node = Node(name="a", op="convolve", takes=("input",), kernel=3, stride=2, padding=SAME)
    taps = torch.zeros(1, 1, 3, 3)
    taps[0, 0, 0, 0] = 1.0
    (found,) = GraphNetwork(Graph(nodes=(node,), outputs=("a",)), {"a.weight": taps})(picture())
    assert torch.equal(found, picture()[..., ::2, ::2])


def test_a_value_stays_until_its_last_use():
    nodes = (
        Node(name="a", op="relu", takes=("input",)),
        Node(name="b", op="add", takes=("a", "input")),
        Node(name="c", op="concatenate", takes=("b", "a")),
    )
    found = GraphNetwork(Graph(nodes=nodes, outputs=("a", "c")), {})(picture())
    assert torch.equal(found[1], torch.cat([2 * picture(), found[0]], dim=1))


def test_a_converted_graph_pads_convolves_and_adds_as_the_given_one():
    kernel = np.random.default_rng(0).normal(size=(3, 3, 1, 2)).astype(np.float16)
    bias = np.array([1.0, -1.0], np.float16)
    strides = {"list": {"i": ["1", "2", "2", "1"]}}
    valid = {"s": "VkFMSUQ="}
    nodes = [
        {"name": "pad", "op": "Pad", "input": ["x", "pads"]},
        {"name": "turned", "op": "Transpose", "input": ["pad", "order"]},
        {
            "name": "conv",
            "op": "Conv2D",
            "input": ["turned", "kernel"],
            "attr": {"strides": strides, "padding": valid},
        },
        {"name": "sum", "op": "Add", "input": ["conv", "bias"]},
        {"name": "out", "op": "LeakyRelu", "input": ["sum"], "attr": {"alpha": {"f": 0.1}}},
    ]
    values = {"pads": np.array([[0, 0], [0, 0], [1, 1], [1, 1]]), "kernel": kernel, "bias": bias}
    converter = Converter({"modelTopology": {"node": nodes}}, values, "x")
    end, _ = converter.convert("out")
    graph = Graph(nodes=tuple(Node(**node) for node in converter.nodes), outputs=(end,))
    weights = {name: torch.from_numpy(tensor) for name, tensor in converter.weights.items()}
    (found,) = GraphNetwork(graph, weights)(picture() / 64)
    taps = torch.from_numpy(kernel.transpose(3, 2, 0, 1).copy()).float()
    expected = torch.conv2d(picture() / 64, taps, torch.from_numpy(bias).float(), 2, 1)
    assert torch.allclose(found, torch.nn.functional.leaky_relu(expected, 0.1))


@pytest.mark.parametrize("name", DIGESTS)
def test_embedded_weights_are_those_this_version_was_made_with(name):
    assert embedded_weights(name).digest == DIGESTS[name]
    assert DIGESTS[name] in (FOLDER / "NOTICE.md").read_text()


def test_weights_of_another_kind_are_refused(tmp_path):
    path = tmp_path / "net.safetensors"
    with pytest.raises(InputError, match="no file"):
        read_weights(path)
    path.write_bytes(b"\x80\x04pickle")
    with pytest.raises(InputError, match="safetensors"):
        read_weights(path)


def test_a_file_is_the_whole_network(tmp_path):
    graph = Graph(nodes=(Node(name="a", op="relu6", takes=("input",)),), outputs=("a",))
    path = tmp_path / "net.safetensors"
    save_file({"unused": np.zeros(1, np.float32)}, path, {"graph": graph.model_dump_json()})
    assert graph_network(read_weights(path))(picture())[0].max() == 6.0


def test_four_groups_of_channels_become_blocks_of_pixels():
    values = torch.arange(8.0).view(1, 8, 1, 1)
    graph = Graph(nodes=(Node(name="a", op="depth_to_space", takes=("input",)),), outputs=("a",))
    (spread,) = GraphNetwork(graph, {})(values)
    assert spread[0].tolist() == [[[0, 2], [4, 6]], [[1, 3], [5, 7]]]


def test_widening_adds_empty_channels():
    node = Node(name="a", op="widen", takes=("input",), channels=2)
    (wide,) = GraphNetwork(Graph(nodes=(node,), outputs=("a",)), {})(torch.ones(1, 3, 4, 5))
    assert wide.shape == (1, 5, 4, 5)
    assert wide[0, :3].min() == 1
    assert wide[0, 3:].max() == 0


def test_weights_stored_as_bytes_are_steps_of_a_scale():
    node = Node(name="a", op="convolve", takes=("input",))
    weights = {
        "a.weight": torch.tensor([[[[100]]], [[[-50]]]], dtype=torch.int8),
        "a.scale": torch.tensor([0.01, 0.1]).view(2, 1, 1, 1),
        "a.bias": torch.tensor([0.0, 1.0]),
    }
    (found,) = GraphNetwork(Graph(nodes=(node,), outputs=("a",)), weights)(torch.ones(1, 1, 1, 1))
    assert found.flatten().tolist() == pytest.approx([1.0, -4.0])
