"""Laws of measuring changes of light on the person."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mocoflow_core.capture.extract import CaptureConfig, extract_clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.planning.brightness import brightness_shifts
from mocoflow_core.planning.clip_decisions import decide_appearance
from mocoflow_core.planning.configuration import PlanConfig
from tests.capsule_person import default_recipe, write_scene

RECIPE = default_recipe()


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    folder = write_scene(tmp_path_factory.mktemp("scene"), RECIPE)
    return extract_clip(open_scene(folder), CaptureConfig())


def test_constant_light_has_no_shift(clip):
    assert np.nanmax(np.abs(brightness_shifts(clip, RECIPE.meshes))) < 0.01


@pytest.mark.parametrize("gain", [0.8, 1.2])
def test_a_darker_or_brighter_frame_is_measured(clip, gain):
    frames = clip.frames.astype(float)
    frames[2] *= gain
    changed = replace(clip, frames=frames.clip(0, 255).astype(np.uint8))
    shift = brightness_shifts(changed, RECIPE.meshes)[2]
    # The person is red (230, 30, 40): its brightness is about a third.
    assert shift == pytest.approx((gain - 1) * 0.36, abs=0.03)


def test_a_person_out_of_sight_is_unknown(clip):
    nobody = replace(clip, masks=clip.masks & False)
    assert np.isnan(brightness_shifts(nobody, RECIPE.meshes)).all()


def test_held_out_frames_decide_nothing(clip):
    held_out = np.zeros(len(clip.frames), bool)
    held_out[1] = True
    kept = replace(clip, held_out=held_out)
    frames = np.array(clip.frames)
    frames[1] = 255 - frames[1]
    changed = replace(kept, frames=frames)
    first, second = (decide_appearance(c, RECIPE.meshes, PlanConfig()) for c in (kept, changed))
    assert first == second
