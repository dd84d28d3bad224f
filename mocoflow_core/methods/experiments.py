"""The paper's experiments by name: what a benchmark compares, unless it is told otherwise."""

from __future__ import annotations

from typing import NamedTuple

from mocoflow_core.methods.ablations import SERIES


class Experiment(NamedTuple):
    """What is compared, and what it is to show."""

    title: str
    about: str
    scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ("mocoflow", "posed_mesh")
    presets: tuple[str, ...] = ("fast",)
    settings: tuple[str, ...] = ()
    shifts_views: bool = False  # measures photographs against themselves; needs no method


# A benchmark that follows no experiment.
USUAL = Experiment("Scores", "")

# The paper's presets train for days; schedule.scale shrinks them.
_REMOVABLE = (
    *("without_consensus", "without_global", "without_local", "without_initialisation"),
    *("without_box", "without_c2f", "with_ray_direction"),
)
_STEPPING = ("walk_noise6", "dance_noise6")

EXPERIMENTS: dict[str, Experiment] = {
    "removal": Experiment(
        "What is lost without each part",
        "The whole method, and the method with one part taken out or changed (paper, Table 3).",
        scenes=_STEPPING,
        methods=("mocoflow", *_REMOVABLE, "posed_mesh"),
        presets=("paper",),
    ),
    "progressive": Experiment(
        "What each part adds",
        "Each line has one part more than the line before; the last is the whole method (paper, "
        "Table 4).",
        scenes=_STEPPING,
        methods=(*SERIES, "posed_mesh"),
        presets=("paper",),
    ),
    "misalignment": Experiment(
        "What the scores make of a misplaced view",
        "Photographs scored against themselves, moved and turned (paper, Table 1).",
        scenes=("turn",),
        methods=(),
        shifts_views=True,
    ),
    "partial_observation": Experiment(
        "When the back is never seen",
        "Learned from all frames, and from those alone that show at least half of the side of the "
        "body that faced the camera in the first frame. Both are scored at these frames.",
        scenes=("turn", "turn_noise6"),
        methods=("mocoflow", "partial_observation", "posed_mesh"),
        settings=("evaluation.least_shown=0.5",),
    ),
    "train_camera": Experiment(
        "Learned from another camera",
        "The same performance and the same meshes; the former train camera evaluates.",
        scenes=("dance_noise6", "dance_noise6@cam02"),
    ),
    "worse_estimate": Experiment(
        "A worse mesh to start from",
        "Joints wrong by 3, 6 and 12 degrees (root mean square): the given mesh, and what the "
        "optimisation makes of it.",
        scenes=tuple(f"turn_noise6,joint_noise_deg={degrees}" for degrees in (3, 6, 12)),
    ),
}
