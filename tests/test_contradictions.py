from __future__ import annotations

import pytest

from mocoflow_core.contradictions import (
    OWN_FIELDS,
    READ_BY_DECISION,
    changed_fields,
    require_sense,
)
from mocoflow_core.errors import InputError
from mocoflow_core.presets import PRESETS
from mocoflow_core.settings import field_names, with_settings


def check(preset: str, *settings: str) -> None:
    whole = PRESETS[preset]()
    require_sense(with_settings(whole, settings), whole)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_as_it_is_contradicts_nothing(preset):
    check(preset)


def test_every_part_that_the_table_names_is_one():
    names = list(field_names(PRESETS["fast"]()))
    for part in (*OWN_FIELDS["hybrid"], *OWN_FIELDS["networks"], *READ_BY_DECISION.values()):
        assert any(f"{name}.".startswith(f"{part}.") for name in names), part


def test_no_field_belongs_to_both_representations():
    assert not set(OWN_FIELDS["hybrid"]) & set(OWN_FIELDS["networks"])


@pytest.mark.parametrize(
    ("preset", "setting", "other"),
    [
        ("fast", "networks.radiance.width=32", "networks"),
        ("toy", "box.margin_z_m=0.1", "networks"),
        ("fast", "mesh_views.views=3", "networks"),
        ("fast", "schedule.fit_steps=3", "networks"),
        ("fast", "plan.initialisation=off", "networks"),
        ("paper", "canonical.levels=2", "hybrid"),
        ("paper", "motion.body.node_spacing_m=0.1", "hybrid"),
        ("paper_aist", "sampling.step_m=0.03", "hybrid"),
        ("paper", "density.spacing_m=0.03", "hybrid"),
        ("paper", "losses.smoothness_weight=1", "hybrid"),
        ("paper", "plan.fixed_light=off", "hybrid"),
    ],
)
def test_what_the_representation_never_reads_is_refused_naming_both(preset, setting, other):
    field = setting.partition("=")[0]
    chosen = PRESETS[preset]().representation
    with pytest.raises(InputError, match=f"{field} needs representation={other}.*={chosen}"):
        check(preset, setting)


def test_both_read_what_they_share():
    for preset in ("fast", "paper"):
        check(preset, "losses.global_share=0.5", "schedule.first_bands=1.0", "plan.still_px=1")


def test_a_value_that_the_preset_has_already_was_set_by_nobody():
    check("fast", "networks.colour_width=128")


def test_another_representation_may_be_put_on_a_preset_with_its_own_fields():
    networks = ("representation=networks", "schedule.pretrain_steps=5", "schedule.fit_steps=5")
    check("toy", *networks, "networks.colour_width=8")
    with pytest.raises(InputError, match=r"density\.spacing_m"):
        check("toy", *networks, "density.spacing_m=0.01")


def test_networks_never_start_from_scratch_in_silence():
    # A preset without stages of theirs, one stage left out, a scale that rounds both away.
    for preset, setting in (
        ("toy", "representation=networks"),
        ("paper", "schedule.pretrain_steps=0"),
        ("paper", "schedule.scale=1e-6"),
    ):
        with pytest.raises(InputError, match=r"plan\.initialisation"):
            check(preset, setting)
    check("paper", "schedule.scale=1e-6", "plan.initialisation=off")


def test_settings_of_a_repair_that_the_preset_leaves_out_are_refused():
    with pytest.raises(InputError, match=r"plan\.body_repair=auto"):
        check("paper", "repair.colours.independent_points=0")
    check("paper", "repair.colours.independent_points=0", "plan.body_repair=auto")
    # Of an ablation of it the settings are those of the others.
    check("fast", "repair.colours.independent_points=9", "plan.body_repair=off")


@pytest.mark.parametrize(
    ("preset", "settings", "because"),
    [
        ("fast", ("plan.motion_consensus=on", "losses.consensus_weight=0"), "needs a weight"),
        ("fast", ("plan.motion_consensus=on", "plan.motion_residual=off"), "motion_residual"),
        ("paper", ("plan.motion_consensus=on", "plan.motion_fields=off"), "motion_fields"),
        ("fast", ("losses.global_share=0", "losses.local_share=0"), "a term to weigh"),
        ("fast", ("schedule.first_bands=0.5", "schedule.last_bands=0.2"), "first_bands"),
        ("fast", ("plan.narrowest_shell_m=0.2",), "widest_shell_m"),
        (
            "paper",
            ("plan.initialisation=on", "schedule.pretrain_steps=0", "schedule.fit_steps=0"),
            "needs steps",
        ),
    ],
)
def test_switches_that_contradict_each_other_are_refused(preset, settings, because):
    with pytest.raises(InputError, match=because):
        check(preset, *settings)


def test_changed_fields_are_named_by_their_dots():
    whole = PRESETS["fast"]()
    changed = with_settings(whole, ["losses.consensus_weight=1", "schedule.rays=3"])
    assert changed_fields(changed, whole) == ["losses.consensus_weight", "schedule.rays"]
