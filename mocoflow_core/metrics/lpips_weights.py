"""The weights of LPIPS from a file of the user's own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_torch
from mocoflow_core.perception.embedded import Weights, embedded_weights, read_weights
from mocoflow_core.perception.network_file import FileOfNetwork

ADVICE = (
    "Give a .safetensors with conv0 to conv4 and lin0 to lin4, or torchvision's weights of AlexNet."
)
# torchvision's numbers of the five convolutions.
TORCHVISION_LAYERS = (0, 3, 6, 8, 10)


def own_lpips_weights(file: FileOfNetwork) -> Weights:
    """The tensors that ``LpipsAlex`` takes: an AlexNet with its heads, or with the official ones.

    Raises:
        InputError: no file, another network, other sizes, or numbers that are not finite.
    """
    file.require()
    official = embedded_weights("lpips_alex").tensors
    if file.path.suffix.lower() == ".safetensors":
        tensors = read_weights(file.path).tensors
    else:
        heads = {name: head for name, head in official.items() if name.startswith("lin")}
        tensors = heads | _of_torchvision(file.path)
    _check(file.path, tensors, official)
    return Weights({name: tensors[name] for name in official}, {}, file.digest)


def _of_torchvision(path: Path) -> dict[str, Tensor]:
    """The convolutions of torchvision's AlexNet under our names; its classifier is left out."""
    content = read_torch(path)
    if not isinstance(content, dict):
        raise InputError(f"{path.name} as weights of AlexNet", type(content).__name__, ADVICE)
    names = {
        f"features.{theirs}.{part}": f"conv{ours}.{part}"
        for ours, theirs in enumerate(TORCHVISION_LAYERS)
        for part in ("weight", "bias")
    }
    return {
        ours: torch.from_numpy(np.array(content[theirs]))
        for theirs, ours in names.items()
        if isinstance(content.get(theirs), np.ndarray)
    }


def _check(path: Path, tensors: Mapping[str, Tensor], official: Mapping[str, Tensor]) -> None:
    for name, known in official.items():
        if name not in tensors:
            got = f"none among {len(tensors)} tensors"
        elif tensors[name].shape != known.shape:
            got = f"one of {tuple(tensors[name].shape)}"
        elif not torch.isfinite(tensors[name]).all():
            got = "one with NaN or infinity"
        else:
            continue
        required = f"{path.name} with {name} {tuple(known.shape)} of AlexNet for LPIPS"
        raise InputError(required, got, ADVICE)
