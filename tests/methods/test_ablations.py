from __future__ import annotations

import pytest
from pydantic import BaseModel

from mocoflow_core.methods.ablations import ABLATIONS, SETTINGS
from mocoflow_core.presets import PRESETS
from mocoflow_core.settings import field_names, with_settings


def fields(configuration: BaseModel) -> dict[str, object]:
    """Every value by its dotted name."""
    values = {}
    for name in field_names(configuration):
        value: object = configuration
        for part in name.split("."):
            value = getattr(value, part)
        values[name] = value
    return values


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("name", ABLATIONS)
def test_an_ablation_changes_its_field_and_nothing_else(name, preset):
    whole = PRESETS[preset]()
    before, after = fields(whole), fields(with_settings(whole, SETTINGS[name]))
    assert {field for field in before if before[field] != after[field]} == {ABLATIONS[name].field}
    assert after[ABLATIONS[name].field] == ABLATIONS[name].value


def test_no_two_ablations_are_the_same():
    assert len({ablation.field for ablation in ABLATIONS.values()}) == len(ABLATIONS)


def test_the_whole_method_changes_nothing():
    for preset in PRESETS.values():
        assert with_settings(preset(), SETTINGS["mocoflow"]) == preset()
