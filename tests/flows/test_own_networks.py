"""Laws of networks that are named on the command line."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from flows.command_line import main
from flows.request import Request
from mocoflow_core.datasets.import_dataset import configure, import_dataset
from mocoflow_core.datasets.kinds import KINDS
from mocoflow_core.errors import InputError
from mocoflow_core.metrics.person_judge import open_networks
from mocoflow_core.perception.embedded import FOLDER
from mocoflow_core.presets import Configuration

GRAPHS = Path(__file__).parents[1] / "data" / "detectors"
MASK, KEYPOINT = GRAPHS / "mask.onnx", GRAPHS / "keypoint.onnx"
ALEX = FOLDER / "lpips_alex.safetensors"


def request(scene, *settings: str) -> Request:
    return Request(scene_path=scene, preset="toy", settings=settings)


def test_networks_by_path_judge_and_stand_in_every_protocol(toy_scene):
    chosen = request(
        toy_scene,
        f"person_scores.detector={MASK}",
        f"person_scores.keypoints={KEYPOINT}",
        f"person_scores.lpips={ALEX}",
        "person_scores.use=auto",
    ).configuration.person_scores
    judge, lpips = open_networks(chosen)
    for file, protocol in (
        (chosen.detector, judge.plausibility_protocol()),
        (chosen.keypoints, judge.oks_protocol()),
    ):
        assert f"R-CNN {file.path.name} {file.digest[:12]}" in protocol
    assert lpips.digest == chosen.lpips.digest


def test_a_network_counts_by_its_content_wherever_it_lies(toy_scene, tmp_path):
    moved, other = tmp_path / "mask.onnx", tmp_path / "other" / "mask.onnx"
    other.parent.mkdir()
    shutil.copy(MASK, moved)
    shutil.copy(KEYPOINT, other)

    def recorded(path):
        chosen = request(toy_scene, f"person_scores.detector={path}").configuration
        return chosen.model_dump(mode="json")["person_scores"]["detector"]

    assert recorded(moved) == recorded(MASK) != recorded(other)


def test_a_record_is_a_configuration_again(toy_scene):
    chosen = request(toy_scene, f"person_scores.lpips={ALEX}").configuration
    text = json.dumps(chosen.model_dump(mode="json"))
    again = Configuration.model_validate(json.loads(text)).person_scores.lpips
    assert (again.path.name, again.digest) == (ALEX.name, chosen.person_scores.lpips.digest)


def test_the_network_that_makes_the_masks_judges_nothing(toy_scene):
    with pytest.raises(InputError, match="another network than the one"):
        _ = request(
            toy_scene, f"person_scores.detector={MASK}", f"video.segmenter={MASK}"
        ).configuration


@pytest.mark.parametrize("field", ["detector", "keypoints", "lpips"])
def test_a_wrong_file_is_one_line_before_any_work(monkeypatch, capsys, tmp_path, toy_scene, field):
    wrong = tmp_path / "wrong.safetensors"
    save_file({"weight": torch.zeros(2)}, wrong)
    out = str(tmp_path / "out")
    words = ["reconstruct", str(toy_scene), "--preset", "toy", "--out", out]
    words += ["--set", "person_scores.use=auto", "--set", f"person_scores.{field}={wrong}"]
    monkeypatch.setattr(sys, "argv", ["mocoflow", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert "wrong.safetensors" in said
    assert not (tmp_path / "out").exists()


def test_a_path_to_nothing_names_the_field(toy_scene):
    with pytest.raises(InputError, match=r"person_scores\.lpips must be .*nothing at"):
        _ = request(toy_scene, "person_scores.lpips=/nowhere/alex.pth").configuration


def test_an_import_names_the_field_too(tmp_path):
    (tmp_path / "film.mp4").write_bytes(b"no film")
    video = KINDS["video"]
    chosen = configure(video, ("segmenter=/nowhere/mask.onnx",), None)
    with pytest.raises(InputError, match=r"segmenter must be .*nothing at"):
        import_dataset(video, tmp_path / "film.mp4", chosen, tmp_path / "scene")
