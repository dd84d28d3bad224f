"""Ablations: mocoflow with one named field of its configuration changed, and nothing else."""

from __future__ import annotations

import json
from typing import NamedTuple


class Ablation(NamedTuple):
    """One field, the value that switches something off, and what that removes."""

    field: str
    value: float | str
    removes: str

    @property
    def setting(self) -> str:
        """As it is written in ``--set``."""
        return f"{self.field}={json.dumps(self.value)}"


ABLATIONS: dict[str, Ablation] = {
    "without_consensus": Ablation(
        "losses.consensus_weight", 0.0, "the motion consensus (paper: without L_moco)"
    ),
    "without_global": Ablation("losses.global_share", 0.0, "the consensus between two frames"),
    "without_local": Ablation("losses.local_share", 0.0, "the consensus within a frame"),
    "without_residual": Ablation(
        "plan.motion_residual", "off", "the learned correction of the body's motion"
    ),
    "without_smoothness": Ablation(
        "losses.smoothness_weight", 0.0, "the smoothness of that correction in time"
    ),
    "without_repair": Ablation("plan.body_repair", "off", "bending the given mesh before training"),
    "without_colours": Ablation(
        "repair.colours.independent_points", 0, "the colours of the skin in that bending"
    ),
    "without_silhouette": Ablation("losses.silhouette_weight", 0.0, "opacity held to the masks"),
    "without_offset": Ablation("losses.offset_weight", 0.0, "density held to the mesh's surface"),
    "without_appearance": Ablation("plan.appearance_codes", "off", "the code for each image"),
    "without_light": Ablation("plan.fixed_light", "off", "the measured light on the person"),
}

# What each method that runs changes in its preset.
SETTINGS: dict[str, tuple[str, ...]] = {
    "mocoflow": (),
    **{name: (ablation.setting,) for name, ablation in ABLATIONS.items()},
}
