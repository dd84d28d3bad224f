"""Detectors of the user's own, opened by what their files are."""

from __future__ import annotations

from mocoflow_core.errors import InputError
from mocoflow_core.perception.instances import (
    KEYPOINTS,
    MASKS,
    TITLES,
    InstanceDetector,
    InstanceNetwork,
)
from mocoflow_core.perception.network_file import FileOfNetwork
from mocoflow_core.perception.onnx_network import OnnxNetwork
from mocoflow_core.perception.torchvision_network import TorchvisionNetwork


def own_person_detector(file: FileOfNetwork) -> InstanceDetector:
    """Boxes of persons, from a Mask R-CNN or a Keypoint R-CNN. Raises InputError as they do."""
    return InstanceDetector(_network(file))


def own_keypoint_detector(file: FileOfNetwork) -> InstanceDetector:
    """Keypoints, from a Keypoint R-CNN. Raises InputError for anything else."""
    return InstanceDetector(_giving(KEYPOINTS, file))


def own_segmenter(file: FileOfNetwork) -> InstanceDetector:
    """Masks of persons, from a Mask R-CNN. Raises InputError for anything else."""
    return InstanceDetector(_giving(MASKS, file))


def _giving(needed: str, file: FileOfNetwork) -> InstanceNetwork:
    network = _network(file)
    if needed not in network.gives:
        named = next(title for gives, title in TITLES.items() if needed in gives)
        raise InputError(
            f"a {named}, which gives {needed}",
            f"a {TITLES[network.gives]} in {file.path.name}",
            "Give the other one.",
        )
    return network


def _network(file: FileOfNetwork) -> InstanceNetwork:
    """ONNX by its suffix, else weights of torchvision."""
    file.require()
    if file.path.suffix.lower() == ".onnx":
        return OnnxNetwork(file.path)
    return TorchvisionNetwork(file.path)
