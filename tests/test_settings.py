from __future__ import annotations

import re

import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.presets import PRESETS, fast
from mocoflow_core.settings import field_names, with_settings


def test_a_setting_changes_one_field_and_nothing_else():
    changed = with_settings(fast(), ["schedule.rays=17"])
    assert changed.schedule.rays == 17
    assert with_settings(changed, [f"schedule.rays={fast().schedule.rays}"]) == fast()


def test_the_example_in_the_documentation_can_be_set():
    example = re.search(r"``(\S+=\S+)``", with_settings.__doc__).group(1)
    assert with_settings(fast(), [example]) != fast()


def test_values_that_are_no_json_are_text():
    assert with_settings(fast(), ["plan.motion_residual=off"]).plan.motion_residual == "off"


@pytest.mark.parametrize("preset", PRESETS)
def test_every_field_can_be_named(preset):
    configuration = PRESETS[preset]()
    names = list(field_names(configuration))
    assert len(names) == len(set(names))
    assert "capture.fps" in names


@pytest.mark.parametrize(
    ("setting", "closest"),
    [
        ("schedule.ray=3", "schedule.rays"),
        ("rays=3", "schedule.rays"),
        ("capture.FPS=3", "capture.fps"),
    ],
)
def test_an_unknown_field_is_refused_with_the_closest_name(setting, closest):
    with pytest.raises(InputError, match=f"Did you mean {closest}"):
        with_settings(fast(), [setting])


def test_a_setting_without_a_value_is_refused():
    with pytest.raises(InputError, match="field=value"):
        with_settings(fast(), ["schedule.rays"])
