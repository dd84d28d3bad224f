"""Mask R-CNN and Keypoint R-CNN from torchvision's own weights, run by torchvision."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.io.untrusted import read_torch
from mocoflow_core.perception.instances import OF_KEYPOINT_RCNN, OF_MASK_RCNN, Found
from mocoflow_core.perception.person import Picture

ADVICE = "Give the weights of a Mask R-CNN or Keypoint R-CNN (ResNet-50 FPN) of torchvision."
# Tensors that only one of the architectures has, and how many of its classes there are.
KEYPOINT_HEAD = "roi_heads.keypoint_predictor.kps_score_lowres.weight"
MASK_HEAD = "roi_heads.mask_predictor.mask_fcn_logits.weight"
SECOND_VERSION = "rpn.head.conv.1.0.weight"
CLASSES = "roi_heads.box_predictor.cls_score.weight"

Tensors = Mapping[str, NDArray[np.generic]]


class TorchvisionNetwork:
    """One network on the CPU; which one, its tensors say."""

    def __init__(self, path: Path) -> None:
        """Raises InputError without torchvision, and for other weights."""
        self.file = path.name
        self.digest = digest_file(path)
        tensors = _state(path)
        architecture, self.gives = _architecture(path, tensors)
        model = getattr(_detection(), architecture)(
            weights=None, weights_backbone=None, num_classes=len(tensors[CLASSES])
        )
        values = {name: torch.from_numpy(np.array(value)) for name, value in tensors.items()}
        try:
            model.load_state_dict(values)
        except RuntimeError as error:
            first = " ".join(str(error).split())[:200]
            raise InputError(f"{path.name} as {architecture}", first, ADVICE) from error
        self._model = model.eval()

    def find(self, image: Picture) -> Found:
        picture = torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1))).float() / 255
        with torch.no_grad():
            (found,) = self._model([picture])
        return {name: found[name].numpy() for name in self.gives}


def _state(path: Path) -> Tensors:
    """Tensors by name; nothing in the file can run."""
    content = read_torch(path)
    if isinstance(content, dict) and isinstance(content.get("model"), dict):
        content = content["model"]
    if not isinstance(content, dict) or not all(
        isinstance(value, np.ndarray | np.generic | int) for value in content.values()
    ):
        raise InputError(f"{path.name} as a network's tensors", "something else", ADVICE)
    return content


def _architecture(path: Path, tensors: Tensors) -> tuple[str, tuple[str, ...]]:
    """torchvision's name of the network, and what it gives."""
    if CLASSES in tensors and KEYPOINT_HEAD in tensors:
        return "keypointrcnn_resnet50_fpn", OF_KEYPOINT_RCNN
    if CLASSES in tensors and MASK_HEAD in tensors:
        version = "_v2" if SECOND_VERSION in tensors else ""
        return f"maskrcnn_resnet50_fpn{version}", OF_MASK_RCNN
    names = ", ".join(list(tensors)[:3])
    raise InputError(f"{path.name} as a detector of torchvision", f"tensors {names}, ...", ADVICE)


def _detection() -> Any:  # noqa: ANN401 - torchvision is optional.
    try:
        from torchvision.models import detection
    except (ImportError, OSError, RuntimeError) as error:
        said = next(iter(str(error).splitlines()), "")
        raise InputError(
            "torchvision, built for this torch, to run torchvision's weights",
            f"none that works ({said})",
            "pip install 'mocoflow[torchvision]', or export the network to ONNX: docs/networks.md.",
        ) from error
    return detection
