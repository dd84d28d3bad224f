"""The weights that come with the package, checked before they are used."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from safetensors import SafetensorError, safe_open
from torch import Tensor

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.perception.graph import Graph, GraphNetwork

FOLDER = Path(__file__).parent / "weights"

DIGESTS = {
    "blazepose_detector": "50bc5f510939e11946ed68b9981124dce1496f32ce6b5b382840235266302c3f",
    "blazepose_landmark_heavy": "aeefef011581cad851eebab57aa360bb5dbe39b17db8907199ba09ae177a5ac7",
    "nanodet": "f3006c9c4c459ecb851225d35b2d63154a3a436859df16812976f763d4eb5a7f",
    "movenet_thunder": "2f07ad075593f5286cae0791044cad469f570b8baedb0dd7319ebec5ca7b19e2",
    "lpips_alex": "9501dadd8d5f780ca26930ff3aa6d003bc7d19ffe5bf598c8a2ee678a176efe4",
}


@dataclass(frozen=True, eq=False)
class Weights:
    """Tensors by name, the text beside them, and the sha256 of the file."""

    tensors: dict[str, Tensor]
    metadata: dict[str, str]
    digest: str


def embedded_weights(name: str) -> Weights:
    """The weights ``name`` of this package.

    Raises:
        InputError: the file is missing or is not the one that this version was made with.
    """
    path = FOLDER / f"{name}.safetensors"
    if not path.is_file():
        raise InputError(f"The weights {path.name}", "no such file", "Install mocoflow again.")
    if digest_file(path) != DIGESTS[name]:
        raise InputError(f"The weights {path.name}", "other bytes", "Install mocoflow again.")
    return read_weights(path)


def read_weights(path: Path) -> Weights:
    """The tensors of a safetensors file; reading it runs no code.

    Raises:
        InputError: no such file, or another format.
    """
    if not path.is_file():
        raise InputError("Weights by path", f"no file {path}", "Give a safetensors file.")
    try:
        with safe_open(path, "pt") as file:
            tensors = {key: file.get_tensor(key) for key in file.keys()}
            return Weights(tensors, file.metadata() or {}, digest_file(path))
    except SafetensorError as error:
        raise InputError(f"{path} as safetensors", str(error), "Convert the weights.") from error


def graph_network(weights: Weights) -> GraphNetwork:
    """The network that the file describes."""
    graph = Graph.model_validate_json(weights.metadata["graph"])
    return GraphNetwork(graph, weights.tensors)
