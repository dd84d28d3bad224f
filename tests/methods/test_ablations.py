from __future__ import annotations

from itertools import pairwise

import pytest

from mocoflow_core.contradictions import changed_fields, value_of
from mocoflow_core.errors import InputError
from mocoflow_core.methods.ablations import (
    ABLATIONS,
    SERIES,
    SETTINGS,
    change_of,
    compared_with,
    require_method,
)
from mocoflow_core.presets import PRESETS
from mocoflow_core.settings import with_settings

PAPERS = [name for name in PRESETS if name.startswith("paper")]
# What each representation can do without; the rest of the ablations is refused.
OF_NETWORKS = ("without_initialisation", "without_box", "with_ray_direction")
OF_HYBRID = (
    *("without_residual", "without_smoothness", "without_repair", "without_colours"),
    *("without_silhouette", "without_offset", "without_light"),
)


def makes_sense(method: str, preset: str, settings: tuple[str, ...] = ()) -> bool:
    try:
        require_method(method, PRESETS[preset](), settings)
    except InputError:
        return False
    return True


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("name", ABLATIONS)
def test_an_ablation_changes_its_field_and_nothing_else_or_is_refused(name, preset):
    whole, ablation = PRESETS[preset](), ABLATIONS[name]
    assert makes_sense(name, preset) == (
        name not in (OF_HYBRID if preset in PAPERS else OF_NETWORKS)
    )
    if makes_sense(name, preset):
        after = with_settings(whole, SETTINGS[name])
        assert changed_fields(after, whole) == [ablation.field]
        assert value_of(after, ablation.field) == ablation.value


def test_no_two_ablations_are_the_same():
    assert len({ablation.field for ablation in ABLATIONS.values()}) == len(ABLATIONS)


def test_the_whole_method_changes_nothing():
    for name, preset in PRESETS.items():
        assert with_settings(preset(), SETTINGS["mocoflow"]) == preset()
        assert makes_sense("mocoflow", name)


def test_an_ablation_of_what_is_gone_already_is_refused():
    with pytest.raises(InputError, match=r"without_c2f.*first_bands=1\.0 already"):
        require_method("without_c2f", PRESETS["fast"](), ("schedule.first_bands=1",))
    assert not makes_sense("without_global", "fast", ("losses.local_share=0",))


@pytest.mark.parametrize("preset", PAPERS)
def test_neighbours_in_the_series_differ_in_one_field_and_the_last_is_the_preset(preset):
    whole = PRESETS[preset]()
    steps = [with_settings(whole, SETTINGS[name]) for name in SERIES]
    added = [changed_fields(after, before) for before, after in pairwise(steps)]
    assert added == [
        ["schedule.first_bands"],
        ["plan.initialisation"],
        ["losses.consensus_weight"],
        ["plan.adaptive_box"],
    ]
    assert steps[-1] == whole
    assert all(makes_sense(name, preset) for name in SERIES)


@pytest.mark.parametrize("step", SERIES)
def test_the_series_is_one_of_the_paper_s_presets_alone(step):
    for preset in PRESETS:
        assert makes_sense(step, preset) == (preset in PAPERS)


def test_every_method_is_compared_with_the_one_that_it_differs_from():
    assert compared_with("without_box") == "mocoflow"
    assert compared_with("with_init") == "with_c2f"
    assert compared_with("base") is compared_with("mocoflow") is compared_with("posed_mesh") is None
    for method in (*ABLATIONS, *SERIES):
        assert "." in change_of(method)  # names the field
    assert change_of("mocoflow") == change_of("posed_mesh") == ""
