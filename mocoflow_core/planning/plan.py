"""What the optimisation of a scene needs, decided from measurements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from pydantic import BaseModel, ConfigDict

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from mocoflow_core.planning.canonical_frame import closeness
from mocoflow_core.planning.configuration import PlanConfig
from mocoflow_core.planning.decision import Decision
from mocoflow_core.planning.hybrid_plan import plan_hybrid
from mocoflow_core.planning.network_plan import plan_networks
from mocoflow_core.planning.visibility import unseen_share

Representation = Literal["hybrid", "networks"]

# Decisions that only one of the representations asks for.
OWN_DECISIONS = {
    "hybrid": ("motion_residual", "fixed_light", "wide_shell", "fine_detail"),
    "networks": ("initialisation", "adaptive_box"),
}


class ScenePlan(BaseModel):
    """Every decision with its evidence, and the numbers the fields are built from."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    decisions: tuple[Decision, ...]
    canonical_frame: int  # source number
    unseen_share: float  # of the body's surface, from the train camera
    # Of the fast representation alone:
    shell_width_m: float = 0.0  # density can be so far from the body
    detail_m: float = 0.0  # no cell and no step needs to be finer; 0: as the configuration says
    light: tuple[float, float, float] = (0.0, 0.0, 0.0)  # brightness is 1 + light . normal, world

    def needs(self, name: str) -> bool:
        """Whether the named thing is to be done. Raises KeyError for an unknown name."""
        return self.decision(name).needed

    def decision(self, name: str) -> Decision:
        """The named decision. Raises KeyError for an unknown name."""
        for decision in self.decisions:
            if decision.name == name:
                return decision
        raise KeyError(f"no decision {name!r}: {', '.join(d.name for d in self.decisions)}")

    def no_finer(self, length_m: float) -> float:
        """A cell or step of this length, or a coarser one where pixels cannot show it."""
        return max(length_m, self.detail_m)


def plan_scene(
    clip: Clip,
    meshes: MeshSequence,
    preparation: Sequence[Decision],
    configuration: PlanConfig,
    representation: Representation = "hybrid",
) -> ScenePlan:
    """Decide from the train camera alone.

    Args:
        meshes: world metres, covering the clip.
        preparation: what was decided before, to be listed first.

    Raises:
        InputError: a decision is forced that this representation does not ask for.
    """
    _require_own_decisions(configuration, representation)
    posed = meshes.at(clip.frame_indices)
    frame = _canonical_frame(clip, posed, configuration)
    unseen = unseen_share(clip, posed)
    if representation == "networks":
        decisions = (*preparation, *plan_networks(clip, posed, configuration))
        return ScenePlan(decisions=decisions, canonical_frame=frame, unseen_share=unseen)
    hybrid = plan_hybrid(clip, posed, configuration)
    return ScenePlan(
        decisions=(*preparation, *hybrid.decisions),
        canonical_frame=frame,
        unseen_share=unseen,
        shell_width_m=hybrid.shell_width_m,
        detail_m=hybrid.detail_m,
        light=hybrid.light,
    )


def _canonical_frame(clip: Clip, posed: MeshSequence, configuration: PlanConfig) -> int:
    """Source number of the training frame that canonical space is the observation space of."""
    trained = clip.frame_indices[~clip.held_out]
    if configuration.canonical_frame == "first":
        return int(trained[0])
    return int(trained[closeness(posed.at(trained)).argmin()])


def _require_own_decisions(configuration: PlanConfig, representation: Representation) -> None:
    for other, names in OWN_DECISIONS.items():
        forced = [name for name in names if getattr(configuration, name) != "auto"]
        if other != representation and forced:
            raise InputError(
                f"plan.{forced[0]} decides about representation={other}",
                f"representation={representation}, which has nothing of the kind to leave out",
                f"Leave plan.{forced[0]} on auto, or choose a preset with {other}.",
            )
