"""The synthetic scenes that have names: a motion, alone or with a difficulty, and its settings."""

from __future__ import annotations

from mocoflow_core.errors import InputError
from mocoflow_core.settings import with_settings
from mocoflow_core.synthetic.configuration import SyntheticConfig

_MOTIONS: dict[str, dict[str, object]] = {
    "turn": {"motion": "turn"},
    "walk": {"motion": "walk_circle"},
    "dance": {"motion": "dance"},
    "spin": {"motion": "fast_spin"},
    "still": {"motion": "still"},
}

_DIFFICULTIES: dict[str, dict[str, object]] = {
    "": {},
    "_own_topology": {"mesh_estimate": "exact"},
    "_noise6": {"mesh_estimate": "joint_noise", "joint_noise_deg": 6.0},
    "_other_shape": {"mesh_estimate": "other_shape"},
    "_rootless": {"located": False},
    "_loose": {"clothing": "loose"},
    "_shadows": {"shadows": "cast"},
    "_hard": {
        "mesh_estimate": "joint_noise",
        "joint_noise_deg": 6.0,
        "located": False,
        "clothing": "loose",
        "shadows": "cast",
    },
}

SCENES: dict[str, SyntheticConfig] = {
    motion + difficulty: SyntheticConfig.model_validate(
        {"name": motion + difficulty} | _MOTIONS[motion] | _DIFFICULTIES[difficulty]
    )
    for motion in _MOTIONS
    for difficulty in _DIFFICULTIES
}


def named_scene(name: str) -> SyntheticConfig:
    """The configuration of a named scene, also with settings: ``turn_noise6,joint_noise_deg=3``.

    The scene is called as it is written, unless a setting names it. Raises InputError for an
    unknown name, field or value.
    """
    known, *settings = name.split(",")
    if known not in SCENES:
        raise InputError(
            "A synthetic scene has a known name",
            repr(known),
            f"Choose a motion ({', '.join(_MOTIONS)}), alone or with one of "
            f"{', '.join(filter(None, _DIFFICULTIES))}.",
        )
    return with_settings(SCENES[known].model_copy(update={"name": name}), settings)
