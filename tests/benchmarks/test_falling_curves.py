"""The study of falling curves: what is lost again, and recordings that show only a part."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.falling_table import fall_of, falling_table
from benchmarks.partial_sights import keep_first_frames, narrow_train_camera
from mocoflow_core.capture.extract import CaptureConfig, extract_clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.synthetic.toy import ToyConfig, write_toy_scene


def curve(values, metric="psnr_union") -> list[CurveRow]:
    return [
        CurveRow("turn", "mocoflow", 0, "optimise_scene", step, step, step, metric, value)
        for step, value in enumerate(values)
    ]


@pytest.mark.parametrize(
    ("values", "lost"), [([10.0, 11.0, 12.0], 0.0), ([10.0, 12.5, 12.0], 0.5), ([9.0], 0.0)]
)
def test_what_a_curve_loses_again_is_its_best_less_its_last(values, lost):
    rows = [*curve(values), *curve([99.0, 0.0, 0.0], metric="ssim")]
    assert fall_of(rows).lost == lost
    assert fall_of(rows[::-1]) == fall_of(rows)


def test_the_table_has_the_median_and_the_range_of_the_seeds():
    runs = {
        Contender("turn", "fast", "mocoflow"): {
            seed: curve([10.0, 12.0 + seed, 12.0]) for seed in range(3)
        }
    }
    assert "| 13.00 (12.00 to 14.00) |" in falling_table(runs)
    assert "| 1.00 (0.00 to 2.00) |" in falling_table(runs)


@pytest.fixture
def folder(tmp_path):
    write_toy_scene(tmp_path / "scene", ToyConfig(frames=6, cameras=2))
    return tmp_path / "scene"


def test_a_clip_that_is_cut_off_is_a_scene_of_its_first_frames(folder):
    whole = extract_clip(open_scene(folder), CaptureConfig())
    keep_first_frames(folder, 4)
    clip = extract_clip(open_scene(folder), CaptureConfig())
    assert clip.frame_indices.tolist() == whole.frame_indices[:4].tolist()
    assert np.array_equal(clip.frames, whole.frames[:4])


def test_a_narrowed_camera_sees_the_same_along_the_same_rays(folder):
    train = json.loads((folder / "scene.json").read_text())["train_camera"]
    before, whole = open_scene(folder), extract_clip(open_scene(folder), CaptureConfig())
    narrow_train_camera(folder, 8, 20)
    after, clip = open_scene(folder), extract_clip(open_scene(folder), CaptureConfig())
    assert np.array_equal(clip.frames, whole.frames[:, :, 8:20])
    point = np.array([[0.1, 0.2, 0.3]])
    shift = before.cameras[train].project(point) - after.cameras[train].project(point)
    assert shift == pytest.approx(np.array([[8.0, 0.0]]))
