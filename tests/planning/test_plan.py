"""Each decision follows its evidence, and the configuration has the last word."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mocoflow_core.body.repair import RepairConfig, RoundsConfig
from mocoflow_core.capture.extract import CaptureConfig, extract_clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.ingest import ingest_meshes
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.decision import with_evidence
from mocoflow_core.planning.inspection import inspect_scene
from mocoflow_core.planning.plan import ScenePlan, plan_scene
from mocoflow_core.planning.preparation import (
    decide_background,
    decide_frames,
    decide_location,
    decide_preparation,
    decide_segmentation,
    decide_shadows,
)
from mocoflow_core.planning.repair import repair_where_needed
from mocoflow_core.planning.scoring import decide_evaluation
from tests.capsule_person import capsule_person, default_recipe, edit_description, write_scene

DECISIONS = [
    "background_extraction",
    "mask_segmentation",
    "location_search",
    "repeated_frames",
    "shadow_removal",
    "body_repair",
    "motion_fields",
    "motion_residual",
    "motion_consensus",
    "appearance_codes",
    "fixed_light",
    "wide_shell",
    "fine_detail",
]


ROUND = RoundsConfig(rounds=1, steps=1, rate=0.1, outlier_m=(0.08, 0.02))
QUICK = RepairConfig(by_masks=ROUND, by_both=ROUND)


def planned(folder, change_meshes=lambda meshes: meshes, change_clip=lambda clip: clip, **config):
    scene = open_scene(folder)
    ingested = ingest_meshes(scene)
    clip = change_clip(extract_clip(scene, CaptureConfig()))
    meshes = change_meshes(ingested.meshes)
    chosen = PlanConfig(**config)
    preparation = (
        *decide_preparation(inspect_scene(scene, ingested), chosen),
        decide_frames(0, len(clip.frames), chosen),
        decide_shadows(0.0, "kept", chosen),
        repair_where_needed(clip, meshes, QUICK, chosen.body_repair, lambda share, text: None)[1],
    )
    return plan_scene(clip, meshes, preparation, chosen)


@pytest.fixture
def folder(tmp_path):
    return write_scene(tmp_path, default_recipe())


def bent(meshes):
    """The arms 20 degrees off: an estimate with errors."""
    count = len(meshes.vertices)
    share = np.linspace(0, 1, count)
    places = np.stack([share - 0.5, 0.3 * np.sin(3 * share), 0 * share], axis=-1)
    return capsule_person(2 * share, 0.4 * np.sin(6 * share) - 0.35, places)


def test_a_scene_that_brings_everything_needs_motion_alone(folder):
    plan = planned(folder)
    assert [decision.name for decision in plan.decisions] == DECISIONS
    assert [name for name in DECISIONS if plan.needs(name)] == ["motion_fields"]


def test_every_decision_says_why_and_what_it_saves(folder):
    for decision in planned(folder).decisions:
        assert decision.reason
        assert decision.saves
        assert decision.threshold is not None
        assert decision.evidence


def test_meshes_off_the_masks_need_a_residual_and_its_consensus(folder):
    plan = planned(folder, bent, consistent_m=0.01)
    assert plan.needs("motion_residual")
    assert plan.needs("motion_consensus")
    evidence = plan.decision("motion_residual").evidence
    assert evidence["outline_m"] > plan.decision("motion_residual").threshold


def test_a_body_that_stands_still_needs_no_motion(tmp_path):
    still = capsule_person([0.3] * 5, [0] * 5, np.zeros((5, 3)))
    folder = write_scene(tmp_path, replace(default_recipe(), meshes=still))
    plan = planned(folder)
    assert not plan.needs("motion_fields")
    assert not plan.needs("motion_residual")


def test_missing_plates_and_masks_are_to_be_made(tmp_path):
    folder = write_scene(tmp_path / "a", replace(default_recipe(16), background=False))
    assert planned(folder).needs("background_extraction")
    folder = write_scene(tmp_path / "b", replace(default_recipe(), masks=False))
    assert planned(folder).needs("mask_segmentation")


def test_changing_light_needs_appearance_codes(folder):
    def flickering(clip):
        gains = 1 + 0.2 * (np.arange(len(clip.frames)) % 2)
        frames = clip.frames * gains[:, None, None, None]
        return replace(clip, frames=frames.clip(0, 255).astype(np.uint8))

    assert planned(folder, change_clip=flickering).needs("appearance_codes")


@pytest.mark.parametrize("force", ["on", "off"])
def test_every_decision_can_be_forced(folder, force):
    # Shadows have a setting of their own, capture.behind_person.
    names = [name for name in DECISIONS if name != "shadow_removal"]
    plan = planned(folder, **dict.fromkeys(names, force))
    for name in names:
        assert plan.needs(name) == (force == "on")
        assert f"forced {force}" in plan.decision(name).reason


def test_a_person_as_bright_from_every_side_gets_no_light(folder):
    plan = planned(folder)
    decision = plan.decision("fixed_light")
    assert decision.evidence["strength"] < 0.1 * decision.threshold
    assert plan.light == (0.0, 0.0, 0.0)


def test_forcing_the_residual_off_leaves_nothing_to_regularise(folder):
    plan = planned(folder, bent, consistent_m=0.01, motion_residual="off")
    assert not plan.needs("motion_consensus")


def test_the_location_is_searched_when_it_is_unknown_or_overlaps_badly(folder):
    scene = open_scene(folder)
    inspection = inspect_scene(scene, ingest_meshes(scene))
    assert not decide_location(inspection, PlanConfig()).needed
    unlocated = inspection.model_copy(update={"located": False})
    assert decide_location(unlocated, PlanConfig()).needed
    poor = inspection.model_copy(update={"overlap": 0.3})
    assert decide_location(poor, PlanConfig()).needed


def test_a_body_without_a_location_must_be_searched(folder):
    scene = open_scene(folder)
    nowhere = inspect_scene(scene, ingest_meshes(scene)).model_copy(
        update={"coordinates": "camera-root-centred", "located": False}
    )
    with pytest.raises(InputError, match="root-centred"):
        decide_location(nowhere, PlanConfig(location_search="off"))


def test_evidence_that_could_not_be_measured_is_left_out(folder):
    def nobody(clip):
        return replace(clip, masks=clip.masks & False)

    plan = planned(folder, change_clip=nobody)
    assert ScenePlan.model_validate_json(plan.model_dump_json()) == plan
    # What cannot be shown to be needless is kept.
    assert plan.needs("motion_residual")
    assert plan.needs("appearance_codes")
    assert plan.shell_width_m == PlanConfig().widest_shell_m


def test_the_canonical_frame_is_the_most_spread_one_that_is_trained_on(tmp_path):
    swings = [0.4, 0.2, 0.0, -0.2, -0.5, 0.1]
    meshes = capsule_person([0.1] * 6, swings, np.zeros((6, 3)))
    folder = write_scene(tmp_path, replace(default_recipe(), meshes=meshes))
    assert planned(folder).canonical_frame == 4

    def holding_out(clip):
        return replace(clip, held_out=clip.frame_indices == 4)

    assert planned(folder, change_clip=holding_out).canonical_frame == 3


def test_the_shell_is_as_wide_as_mask_pixels_lie_outside_the_body(folder):
    def thin(meshes):
        return replace(meshes, vertices=meshes.vertices * np.float32([1, 1, 0.93]))

    exact = planned(folder).shell_width_m
    assert exact == PlanConfig().narrowest_shell_m
    # The head now ends 12 cm below the mask's.
    assert 0.06 < planned(folder, thin).shell_width_m <= 0.13


def test_an_unknown_decision_is_an_error(folder):
    with pytest.raises(KeyError, match="no decision 'magic'"):
        planned(folder).needs("magic")


def test_a_plan_survives_as_json(folder):
    plan = planned(folder)
    assert ScenePlan.model_validate_json(plan.model_dump_json()) == plan


def test_other_cameras_decide_about_scores_and_nothing_else(folder):
    assert decide_evaluation(open_scene(folder)).needed
    before = planned(folder)
    edit_description(folder, lambda d: d["cameras"].pop("cam01"))
    assert not decide_evaluation(open_scene(folder)).needed
    assert planned(folder) == before


@pytest.mark.parametrize("force", ["auto", "on", "off"])
def test_the_shell_is_the_narrowest_where_a_wide_one_is_not_needed(folder, force):
    config = PlanConfig()
    width = planned(folder, wide_shell=force).shell_width_m
    assert width == (config.widest_shell_m if force == "on" else config.narrowest_shell_m)


def test_the_shell_has_room_for_an_edge_around_what_the_masks_show(folder):
    def dressed(clip):
        kernel = np.ones((5, 5), np.uint8)
        wider = [cv2.dilate(mask.astype(np.uint8), kernel) > 0 for mask in clip.masks]
        return replace(clip, masks=np.stack(wider))

    plan = planned(folder, change_clip=dressed)
    outside_m = plan.decision("wide_shell").evidence["outside_m"]
    assert plan.needs("wide_shell")
    assert plan.shell_width_m == pytest.approx(outside_m + PlanConfig().shell_margin_m)


def test_cells_and_steps_are_as_coarse_as_pixels_where_these_show_no_more(folder):
    plan = planned(folder)
    pixel_m = plan.decision("fine_detail").evidence["pixel_m"]
    assert not plan.needs("fine_detail")
    assert plan.no_finer(0.01) == pytest.approx(0.5 * pixel_m)
    assert plan.no_finer(1.0) == 1.0
    assert planned(folder, fine_detail="on").no_finer(0.01) == 0.01
    sharp = planned(folder, detail_px=0.1)
    assert sharp.needs("fine_detail")
    assert sharp.no_finer(0.01) == 0.01


def test_an_estimate_off_the_masks_is_repaired_and_an_exact_one_left_alone(folder):
    scene = open_scene(folder)
    clip, exact = extract_clip(scene, CaptureConfig()), ingest_meshes(scene).meshes

    def repaired(meshes, force="auto"):
        return repair_where_needed(clip, meshes, QUICK, force, lambda share, text: None)

    meshes, decision = repaired(exact)
    assert meshes is exact
    assert not decision.needed
    meshes, decision = repaired(bent(exact))
    assert decision.needed
    assert decision.evidence["apart_px"] > decision.threshold
    for force, touched in (("on", True), ("off", False)):
        for given in (exact, bent(exact)):
            meshes, decision = repaired(given, force)
            assert decision.needed == touched
            assert (meshes is not given) == touched


def test_what_the_files_do_not_bring_cannot_be_left_out(tmp_path):
    folder = write_scene(tmp_path / "a", replace(default_recipe(16), background=False))
    inspection = inspect_scene(open_scene(folder), None)
    with pytest.raises(InputError, match="background_extraction"):
        decide_background(inspection, PlanConfig(background_extraction="off"))
    folder = write_scene(tmp_path / "b", replace(default_recipe(), masks=False))
    inspection = inspect_scene(open_scene(folder), None)
    with pytest.raises(InputError, match="mask_segmentation"):
        decide_segmentation(inspection, PlanConfig(mask_segmentation="off"))


def test_repeated_frames_are_counted_in_the_evidence():
    decision = decide_frames(3, 9, PlanConfig())
    assert not decision.needed
    assert decision.reason == "3 of 12 frames repeat another one"
    assert decision.evidence == {"repeated": 3.0, "kept": 9.0}
    assert decide_frames(0, 12, PlanConfig(repeated_frames="on")).needed


def test_shadow_removal_is_what_the_configuration_says_with_what_was_measured():
    kept, plate, faint = (
        decide_shadows(shadowed, behind, PlanConfig())
        for shadowed, behind in ((0.4, "kept"), (0.4, "plate"), (0.01, "kept"))
    )
    assert (kept.needed, plate.needed) == (False, True)
    assert kept.evidence == plate.evidence == {"shadowed": 0.4}
    assert "capture.behind_person=plate removes them" in kept.reason
    assert "shadow" not in faint.reason


def test_what_a_search_measured_stands_beside_the_decision_to_search(folder):
    inspection = inspect_scene(open_scene(folder), None)
    before = decide_preparation(inspection, PlanConfig())
    after = with_evidence(before, "location_search", {"residual": 0.1})
    assert [b != a for b, a in zip(before, after, strict=True)] == [False, False, True]
    assert after[-1].evidence["residual"] == 0.1
