"""Laws of LPIPS weights that users bring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from mocoflow_core.errors import InputError
from mocoflow_core.metrics.lpips_weights import TORCHVISION_LAYERS, own_lpips_weights
from mocoflow_core.metrics.perceptual import LpipsAlex, lpips_protocol
from mocoflow_core.perception.embedded import embedded_weights
from mocoflow_core.perception.network_file import FileOfNetwork

OFFICIAL = embedded_weights("lpips_alex").tensors


def as_torchvision(scale: float = 1.0) -> dict[str, torch.Tensor]:
    """The official convolutions under torchvision's names, and a classifier."""
    tensors = {"classifier.1.weight": torch.zeros(4, 4)}
    for ours, theirs in enumerate(TORCHVISION_LAYERS):
        for part in ("weight", "bias"):
            tensors[f"features.{theirs}.{part}"] = scale * OFFICIAL[f"conv{ours}.{part}"].float()
    return tensors


def opened(path: Path) -> LpipsAlex:
    return LpipsAlex(own_lpips_weights(FileOfNetwork(path)))


def distances(lpips: LpipsAlex) -> float:
    first, second = np.random.default_rng(0).uniform(0, 1, (2, 64, 64, 3)).astype(np.float32)
    return lpips.distance(lpips.features(first), lpips.features(second))


def test_the_same_weights_from_a_file_give_the_same_score(tmp_path):
    save_file(OFFICIAL, tmp_path / "alex.safetensors")
    torch.save(as_torchvision(), tmp_path / "alexnet.pth")
    expected = distances(LpipsAlex())
    assert distances(opened(tmp_path / "alex.safetensors")) == expected
    assert distances(opened(tmp_path / "alexnet.pth")) == pytest.approx(expected, rel=1e-6)


def test_another_backbone_gives_another_score_under_its_own_name(tmp_path):
    torch.save(as_torchvision(0.5), tmp_path / "other.pth")
    lpips = opened(tmp_path / "other.pth")
    assert abs(distances(lpips) - distances(LpipsAlex())) > 1e-3
    assert "of the user's own" in lpips_protocol(lpips)
    assert lpips.digest[:12] in lpips_protocol(lpips)
    assert lpips.digest != LpipsAlex().digest


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"conv1.weight": None}, r"with conv1.weight \(192, 64, 5, 5\).*got none among 14"),
        ({"lin0.weight": torch.zeros(1, 65, 1, 1)}, r"got one of \(1, 65, 1, 1\)"),
        ({"conv4.bias": torch.full((256,), torch.nan)}, "got one with NaN"),
    ],
)
def test_weights_of_something_else_are_refused_in_one_line(tmp_path, change, line):
    tensors = {name: t for name, t in (OFFICIAL | change).items() if t is not None}
    save_file(tensors, tmp_path / "alex.safetensors")
    with pytest.raises(InputError, match=line) as refused:
        opened(tmp_path / "alex.safetensors")
    assert "\n" not in str(refused.value)


def test_files_of_another_kind_are_refused_in_one_line(tmp_path):
    (tmp_path / "text.safetensors").write_text("no weights")
    (tmp_path / "text.pth").write_text("no weights")
    torch.save([1, 2], tmp_path / "list.pth")
    for name in ("text.safetensors", "text.pth", "list.pth"):
        with pytest.raises(InputError, match=name) as refused:
            opened(tmp_path / name)
        assert "\n" not in str(refused.value)
