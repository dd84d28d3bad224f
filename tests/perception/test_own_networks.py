"""Laws of detectors that users bring: tiny graphs, and torchvision's networks where it runs."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from mocoflow_core.errors import InputError
from mocoflow_core.perception.instances import persons_of
from mocoflow_core.perception.network_file import FileOfNetwork
from mocoflow_core.perception.overlap import most_overlapping, overlaps
from mocoflow_core.perception.own_networks import (
    own_keypoint_detector,
    own_person_detector,
    own_segmenter,
)

GRAPHS = Path(__file__).parents[1] / "data" / "detectors"
MASK, KEYPOINT = (FileOfNetwork(GRAPHS / f"{name}.onnx") for name in ("mask", "keypoint"))
# The input's shape in the file: three lengths; two of them and an axis without a length.
FIXED = b"\n\x02\x08\x03\n\x02\x08\x40\n\x02\x08\x40"
ANY = FIXED[:-2] + b"\x12\x00"
# What the graphs always say, most confident first.
RIGHT, LEFT = np.float32([40, 10, 60, 50]), np.float32([10, 10, 30, 50])


def grey(brightness: int, height: int = 64, width: int = 64) -> np.ndarray:
    return np.full((height, width, 3), brightness, np.uint8)


def test_boxes_are_of_persons_alone_most_confident_first():
    for file in (MASK, KEYPOINT):
        black, white = own_person_detector(file).boxes([grey(0), grey(255)])
        np.testing.assert_array_equal(black.corners, [RIGHT, LEFT])
        np.testing.assert_allclose(black.confidence, [1.0, 0.5], atol=1e-6)
        assert white.corners.shape == (0, 4)


def test_pictures_of_any_size_are_scaled_into_the_graphs_and_boxes_and_masks_back():
    picture = grey(255, 96, 128)
    picture[10:40, 90:120] = 0
    picture[:10] = 20
    detector = own_segmenter(MASK)
    (boxes,) = detector.boxes([np.minimum(picture, 80)])
    np.testing.assert_allclose(boxes.corners, [[80, 20, 120, 96], [20, 20, 60, 96]])
    (mask,) = detector.masks([np.minimum(picture, 200)], [boxes.corners[0]])
    assert mask.shape == (96, 128)
    assert mask[12:38, 92:118].min() > 0.95
    assert mask[45:90, 10:120].max() < 0.25


def test_keypoints_are_put_back_by_middles_of_pixels():
    (pose,) = own_keypoint_detector(KEYPOINT).keypoints([grey(0, 128, 128)], [2 * LEFT])
    np.testing.assert_allclose(pose.places[[0, 16]], [[21, 21], [61, 101]], atol=1e-4)


def test_nobody_has_no_mask():
    (nobody,) = own_segmenter(MASK).masks([grey(255)], [RIGHT])
    assert not nobody.any()


def test_a_graph_for_pictures_of_any_size_is_refused(tmp_path):
    (tmp_path / "any.onnx").write_bytes(MASK.path.read_bytes().replace(FIXED, ANY))
    with pytest.raises(InputError, match=r"any.onnx with an input of fixed size"):
        own_person_detector(of(tmp_path / "any.onnx"))


def test_keypoints_are_those_of_the_box_with_confidences_in_bounds():
    boxes = [LEFT + 1, np.float32([300, 300, 310, 310])]
    pose, nobody = own_keypoint_detector(KEYPOINT).keypoints([grey(0)] * 2, boxes)
    assert nobody is None
    np.testing.assert_allclose(pose.places[[0, 16]], [[10.5, 10.5], [30.5, 50.5]])
    np.testing.assert_allclose(pose.confidence[[0, 16]], [0.982, 0.018], atol=1e-3)


def test_the_protocol_names_the_network_its_file_and_its_content():
    detector = own_person_detector(MASK)
    assert (detector.name, detector.digest) == ("Mask R-CNN mask.onnx", MASK.digest)
    assert own_person_detector(KEYPOINT).name == "Keypoint R-CNN keypoint.onnx"


@pytest.mark.parametrize(
    ("opening", "file", "line"),
    [
        (own_keypoint_detector, MASK, "a Keypoint R-CNN, which gives keypoints, got a Mask R-CNN"),
        (own_segmenter, KEYPOINT, "a Mask R-CNN, which gives masks, got a Keypoint R-CNN"),
    ],
)
def test_a_network_for_something_else_is_refused(opening, file, line):
    with pytest.raises(InputError, match=line):
        opening(file)


def of(path: Path) -> FileOfNetwork:
    return FileOfNetwork(path)


def text(path: Path) -> None:
    path.write_text("no network")


def other_weights(path: Path) -> None:
    torch.save({"features.0.weight": torch.zeros(2, 2)}, path)


def safetensors(path: Path) -> None:
    save_file({"weight": torch.zeros(2)}, path)


@pytest.mark.parametrize(
    ("name", "write", "line"),
    [
        ("net.onnx", text, "net.onnx as ONNX"),
        ("net.pth", text, "a file of torch.save|pickle"),
        ("net.pth", other_weights, "net.pth as a detector of torchvision, got tensors features.0"),
        ("net.safetensors", safetensors, "net.safetensors"),
    ],
)
def test_another_file_is_refused_in_one_line(tmp_path, name, write, line):
    write(tmp_path / name)
    with pytest.raises(InputError, match=line) as refused:
        own_person_detector(of(tmp_path / name))
    assert "\n" not in str(refused.value)


def test_no_file_is_refused():
    with pytest.raises(InputError, match="nothing at"):
        _ = of(Path("nowhere.onnx")).digest
    with pytest.raises(InputError, match=r"nowhere\.onnx"):
        own_person_detector(of(Path("nowhere.onnx")))


def test_arrays_of_another_network_are_refused():
    found = {
        "boxes": np.zeros((2, 4)),
        "labels": np.ones(2, int),
        "scores": np.ones(2),
        "masks": np.zeros((2, 1, 8, 8)),
    }
    assert persons_of(found, (8, 8)).masks.shape == (2, 8, 8)
    for spoilt in ({"boxes": np.full((2, 4), np.nan)}, {"masks": np.zeros((2, 1, 8, 9))}):
        with pytest.raises(InputError, match="of 2 instances"):
            persons_of(found | spoilt, (8, 8))


@pytest.mark.parametrize("module", ["onnxruntime", "torchvision.models"])
def test_a_package_that_is_missing_is_named_with_its_extra(tmp_path, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / "weights.pth"
    heads = ("roi_heads.box_predictor.cls_score", "roi_heads.mask_predictor.mask_fcn_logits")
    torch.save({f"{head}.weight": torch.zeros(91, 2) for head in heads}, path)
    file = MASK if module == "onnxruntime" else of(path)
    with pytest.raises(InputError, match=r"pip install 'mocoflow\[") as refused:
        own_person_detector(file)
    assert "\n" not in str(refused.value)


def test_overlaps_are_shares_of_the_union():
    boxes = np.float32([[0, 0, 2, 2], [1, 0, 3, 2], [5, 5, 6, 6]])
    np.testing.assert_allclose(overlaps(boxes[0], boxes), [1, 1 / 3, 0])
    assert most_overlapping(np.float32([4, 4, 6, 6]), boxes) == 2
    assert most_overlapping(np.float32([8, 8, 9, 9]), boxes) is None
    assert most_overlapping(boxes[0], np.zeros((0, 4))) is None


@pytest.fixture(scope="module")
def detection():
    """torchvision's detectors; they do not load beside every build of torch."""
    try:
        from torchvision.models import detection
    except (ImportError, OSError, RuntimeError) as error:
        pytest.skip(f"torchvision: {error}")
    return detection


@pytest.mark.parametrize(
    "architecture",
    ["maskrcnn_resnet50_fpn", "maskrcnn_resnet50_fpn_v2", "keypointrcnn_resnet50_fpn"],
)
def test_weights_of_torchvision_give_what_torchvision_gives(tmp_path, detection, architecture):
    torch.manual_seed(0)
    model = getattr(detection, architecture)(weights=None, weights_backbone=None).eval()
    with torch.no_grad():  # Random weights find nobody: let everything be a person.
        model.roi_heads.box_predictor.cls_score.bias[1] = 10.0
    path = tmp_path / "weights.pth"
    torch.save(model.state_dict(), path)
    picture = np.random.default_rng(0).integers(0, 256, (96, 128, 3), dtype=np.uint8)
    with torch.no_grad():
        (theirs,) = model([torch.from_numpy(picture).permute(2, 0, 1) / 255])
    persons = theirs["labels"] == 1
    detector = own_person_detector(of(path))
    (boxes,) = detector.boxes([picture])
    assert len(boxes.confidence) == int(persons.sum()) > 0
    np.testing.assert_allclose(boxes.corners, theirs["boxes"][persons].numpy(), atol=1e-3)
    if architecture.startswith("mask"):
        (mask,) = detector.masks([picture], [boxes.corners[0]])
        np.testing.assert_allclose(mask, theirs["masks"][persons][0, 0].numpy(), atol=1e-4)
    else:
        (pose,) = detector.keypoints([picture], [boxes.corners[0]])
        expected = theirs["keypoints"][persons][0, :, :2] + 0.5
        np.testing.assert_allclose(pose.places, expected, atol=1e-3)
