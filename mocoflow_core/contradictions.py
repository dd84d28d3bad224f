"""Settings that nothing would read, and switches that contradict each other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from pydantic import BaseModel

from mocoflow_core.errors import InputError
from mocoflow_core.planning.plan import OWN_DECISIONS
from mocoflow_core.presets import Configuration
from mocoflow_core.settings import field_names

# Fields, and parts with all their fields, that one representation alone reads.
OWN_FIELDS = {
    "hybrid": (
        *("density", "motion", "canonical", "sampling", "schedule.rate_features"),
        *("losses.offset_weight", "losses.residual_weight", "losses.smoothness_weight"),
        *("losses.appearance_weight", "plan.light", "plan.faint_light", "plan.consistent_m"),
        *("plan.detail_px", "plan.fine_m", "plan.shell_margin_m"),
        *("plan.narrowest_shell_m", "plan.widest_shell_m"),
        *(f"plan.{name}" for name in OWN_DECISIONS["hybrid"]),
    ),
    "networks": (
        *("networks", "box", "mesh_views", "schedule.pretrain_steps", "schedule.fit_steps"),
        *("losses.fit_weight", "losses.fit_points", "losses.free_margin_m", "losses.free_step_m"),
        "plan.tight_box",
        *(f"plan.{name}" for name in OWN_DECISIONS["networks"]),
    ),
}

# Parts that nothing reads where their decision is off.
READ_BY_DECISION = {"body_repair": "repair", "location_search": "location"}


class Contradiction(NamedTuple):
    """What one setting needs, what another one says instead, and what to do."""

    needed: str
    said: str
    advice: str


def require_sense(chosen: Configuration, preset: Configuration) -> None:
    """Raise InputError for the first setting that would be ignored, or that contradicts another.

    Args:
        chosen: the preset with settings applied; a value that the preset has was set by nobody.
    """
    for found in (*_unread(chosen, preset), *_contradictions(chosen)):
        raise InputError(found.needed, found.said, found.advice)


def changed_fields(chosen: BaseModel, preset: BaseModel) -> list[str]:
    """Dotted names of the fields whose values differ."""
    names = field_names(chosen)
    return [name for name in names if value_of(chosen, name) != value_of(preset, name)]


def value_of(configuration: BaseModel, name: str) -> object:
    """The value of a field by its dotted name."""
    value: object = configuration
    for part in name.split("."):
        value = getattr(value, part)
    return value


def _unread(chosen: Configuration, preset: Configuration) -> Iterator[Contradiction]:
    changed = changed_fields(chosen, preset)
    for representation, own in OWN_FIELDS.items():
        if representation != chosen.representation:
            for name in _within(changed, own):
                yield Contradiction(
                    f"{name} needs representation={representation}",
                    f"representation={chosen.representation}, which does not read it",
                    f"Leave {name} out, or choose a preset with {representation}.",
                )
    for decision, part in READ_BY_DECISION.items():
        if getattr(preset.plan, decision) == getattr(chosen.plan, decision) == "off":
            for name in _within(changed, (part,)):
                yield Contradiction(
                    f"{name} needs plan.{decision}",
                    f"a preset with plan.{decision}=off, which does not read it",
                    f"Leave {name} out, or set plan.{decision}=auto as well.",
                )


def _within(names: Iterable[str], parts: tuple[str, ...]) -> Iterator[str]:
    return (name for name in names if any(f"{name}.".startswith(f"{part}.") for part in parts))


def _contradictions(chosen: Configuration) -> Iterator[Contradiction]:
    plan, losses, schedule = chosen.plan, chosen.losses, chosen.schedule
    if plan.motion_consensus == "on":
        yield from _consensus_of_nothing(chosen)
    if chosen.representation == "networks" and plan.initialisation != "off":
        steps = (schedule.pretraining().joint_steps, schedule.fitting().joint_steps)
        if 0 in steps:
            yield Contradiction(
                "plan.initialisation needs steps in both of its stages",
                f"{steps[0]} of pretraining and {steps[1]} of fitting the motion",
                "Raise schedule.pretrain_steps, fit_steps or scale; or plan.initialisation=off.",
            )
    judges = [file.digest for file in chosen.person_scores.own_files]
    if chosen.video.segmenter and chosen.video.segmenter.digest in judges:
        yield Contradiction(
            "person_scores needs another network than the one that the scene is made with",
            f"video.segmenter={chosen.video.segmenter.path.name} for both",
            "Leave one of them to the networks that come with the package.",
        )
    if schedule.first_bands > schedule.last_bands:
        yield Contradiction(
            "schedule.first_bands must not exceed schedule.last_bands",
            f"{schedule.first_bands:g} above {schedule.last_bands:g}",
            "Bands fade in: let the last share be the larger one.",
        )
    if plan.narrowest_shell_m > plan.widest_shell_m:
        yield Contradiction(
            "plan.narrowest_shell_m must not exceed plan.widest_shell_m",
            f"{plan.narrowest_shell_m:g} above {plan.widest_shell_m:g}",
            "Let the widest be the larger one.",
        )
    if losses.consensus_weight > 0 and losses.global_share == losses.local_share == 0:
        yield Contradiction(
            "losses.consensus_weight above 0 needs a term to weigh",
            "losses.global_share=0 and losses.local_share=0",
            "Set losses.consensus_weight=0 to leave the motion consensus out.",
        )


def _consensus_of_nothing(chosen: Configuration) -> Iterator[Contradiction]:
    """Why a consensus that is forced on could do nothing."""
    if chosen.losses.consensus_weight == 0:
        yield Contradiction(
            "plan.motion_consensus=on needs a weight",
            "losses.consensus_weight=0",
            "Set one of them alone.",
        )
    moves = "motion_residual" if chosen.representation == "hybrid" else "motion_fields"
    if getattr(chosen.plan, moves) == "off":
        yield Contradiction(
            f"plan.motion_consensus=on needs plan.{moves}",
            f"plan.{moves}=off, which leaves no motion to agree",
            "Set both on, or leave both on auto.",
        )
