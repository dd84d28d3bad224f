"""Ablations: mocoflow with one named field of its configuration changed, and nothing else.

The paper's series is made of them too: each of its steps gives back one of the fields that the
step before has changed.
"""

from __future__ import annotations

import json
from typing import NamedTuple

from mocoflow_core.contradictions import require_sense
from mocoflow_core.errors import InputError
from mocoflow_core.presets import Configuration
from mocoflow_core.settings import with_settings


class Ablation(NamedTuple):
    """One field, the value that switches something off or on, and what that changes."""

    field: str
    value: float | str
    does: str

    @property
    def setting(self) -> str:
        """As it is written in ``--set``."""
        return f"{self.field}={json.dumps(self.value)}"


ABLATIONS: dict[str, Ablation] = {
    "without_consensus": Ablation(
        "losses.consensus_weight", 0.0, "no motion consensus (paper: without L_moco)"
    ),
    "without_global": Ablation("losses.global_share", 0.0, "no consensus between two frames"),
    "without_local": Ablation("losses.local_share", 0.0, "no consensus within a frame"),
    "without_initialisation": Ablation(
        "plan.initialisation", "off", "density and motion start without the mesh"
    ),
    "without_box": Ablation(
        "plan.adaptive_box", "off", "one box for the clip instead of one for each frame"
    ),
    "without_c2f": Ablation(
        "schedule.first_bands", 1.0, "all frequency bands from the first step of every stage"
    ),
    "with_ray_direction": Ablation(
        "networks.colour_sees", "point_and_direction", "colours see the viewing direction"
    ),
    "partial_observation": Ablation(
        "capture.least_shown", 0.5, "frames that show less than half of the first frame's side go"
    ),
    "without_residual": Ablation(
        "plan.motion_residual", "off", "no learned correction of the body's motion"
    ),
    "without_smoothness": Ablation(
        "losses.smoothness_weight", 0.0, "that correction may jump from frame to frame"
    ),
    "without_repair": Ablation("plan.body_repair", "off", "the given mesh is not bent"),
    "without_colours": Ablation(
        "repair.colours.independent_points", 0, "the mesh is bent without the colours of the skin"
    ),
    "without_silhouette": Ablation("losses.silhouette_weight", 0.0, "opacity free of the masks"),
    "without_offset": Ablation("losses.offset_weight", 0.0, "density free of the mesh"),
    "without_appearance": Ablation("plan.appearance_codes", "off", "no code for each image"),
    "without_light": Ablation("plan.fixed_light", "off", "no measured light on the person"),
}

# The paper's series (Table 4): what each step adds to the one before, given by its ablation.
SERIES: dict[str, str | None] = {
    "base": None,
    "with_c2f": "without_c2f",
    "with_init": "without_initialisation",
    "with_moco": "without_consensus",
    "with_box": "without_box",
}


def _of_step(step: int) -> tuple[str, ...]:
    """What is still missing after a step of the series, as settings."""
    missing = list(SERIES.values())[step + 1 :]
    return tuple(ABLATIONS[name].setting for name in missing if name is not None)


# What each method that runs changes in its preset.
SETTINGS: dict[str, tuple[str, ...]] = {
    "mocoflow": (),
    **{name: (ablation.setting,) for name, ablation in ABLATIONS.items()},
    **{name: _of_step(step) for step, name in enumerate(SERIES)},
}


def require_method(method: str, preset: Configuration, settings: tuple[str, ...]) -> None:
    """Raise InputError where a method makes no sense with a preset and settings on top of it."""
    whole = with_settings(preset, settings)
    chosen = with_settings(whole, SETTINGS[method])
    if method in SERIES and chosen.representation != "networks":
        raise InputError(
            f"{method} is a step of the paper's series and needs representation=networks",
            f"representation={chosen.representation}",
            "Choose a preset of the paper.",
        )
    require_sense(chosen, preset)
    if method in ABLATIONS and chosen == whole:
        raise InputError(
            f"{method} needs a configuration that it changes",
            f"{ABLATIONS[method].setting} already",
            "Leave the method out.",
        )


def compared_with(method: str) -> str | None:
    """The method that differs in one field: the whole one, or the step before in the series."""
    steps = list(SERIES)
    if method in steps[1:]:
        return steps[steps.index(method) - 1]
    return "mocoflow" if method in ABLATIONS else None


def change_of(method: str) -> str:
    """What distinguishes a method from the one it is compared with, in words with its setting."""
    if method in ABLATIONS:
        return f"{ABLATIONS[method].does} ({ABLATIONS[method].setting})"
    given_back = SERIES.get(method)
    if given_back is not None:
        return f"the step before, with {ABLATIONS[given_back].field} as in the preset"
    return f"the preset with {', '.join(SETTINGS[method])}" if method in SERIES else ""
