"""Body models as they are distributed: SMPL's pickles of any age, and ``.npz`` files.

Nothing is imported that the files mention (chumpy, scipy), and no model comes with this package:
the models are licensed to persons. Source: the keys of ``smplx/body_models.py``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.smpl_checks import require_sane
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_untrusted

Family = Literal["SMPL", "SMPL-X"]

SMPL_URL = "https://smpl.is.tue.mpg.de"
SMPLX_URL = "https://smpl-x.is.tue.mpg.de"
_EXAMPLES: dict[Family, str] = {
    "SMPL": "SMPL_NEUTRAL.pkl (or the male or female one)",
    "SMPL-X": "SMPLX_NEUTRAL.npz",
}
WITHOUT_MODEL = (
    "Sources that carry vertices need no model, only its faces: VIBE, WHAM, ROMP with its mesh "
    "option, ZJU-MoCap, mesh sequences."
)

_KEYS = ("v_template", "f", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table")
# SMPL-X keeps expressions behind the shape in one array: 300 + 100, or 10 + 10 in older files.
_SMPLX_JOINTS = 55
_SHAPES_OF_SMPLX = {400: 300, 20: 10}


def read_smpl_model(path: Path) -> SmplModel:
    """The model in a file, float32: SMPL, SMPL-H or SMPL-X; ``.pkl`` or ``.npz`` by its content.

    Expressions, landmarks and hand components are left out; the hands' rest is flat.

    Raises:
        InputError: no such file, with where it is to be had; not a body model; arrays that
            disagree, are not finite or not in metres; weights or a skeleton that make no sense.
    """
    if not path.is_file():
        raise missing_model(f"none at {path}")
    content = read_untrusted(path)
    if not isinstance(content, dict) or any(key not in content for key in _KEYS):
        keys = ", ".join(str(key) for key in content) if isinstance(content, dict) else "no names"
        raise InputError(
            f"{path} must be a body model with {', '.join(_KEYS)}",
            keys[:200] or "none of them",
            f"Take the file as it was downloaded from {SMPL_URL} or {SMPLX_URL}.",
        )
    model = SmplModel(
        template=_numbers(content["v_template"], path),
        faces=_numbers(content["f"], path).astype(np.int32),
        shape_directions=_shape_directions(content, path),
        pose_directions=_numbers(content["posedirs"], path),
        joint_regressor=_numbers(content["J_regressor"], path),
        skinning_weights=_numbers(content["weights"], path),
        parents=_parents(content["kintree_table"], path),
    )
    require_sane(model, path)
    return model


def missing_model(found: str, family: Family = "SMPL", needed: str | None = None) -> InputError:
    """The error for a source that needs a body model where there is none.

    Args:
        found: what is there instead.
        needed: what for, in words that end with the model; by default that a file is needed.
    """
    return InputError(
        needed or f"a {family} model file is needed, such as {_EXAMPLES[family]}",
        found,
        f"{where_to_get(family)} {WITHOUT_MODEL}",
    )


def where_to_get(family: Family = "SMPL") -> str:
    """What a user does to have a body model: they are licensed to persons."""
    if family == "SMPL-X":
        site = SMPLX_URL
    else:
        site = f"{SMPL_URL} (female and male) or https://smplify.is.tue.mpg.de (neutral)"
    return (
        f"Register at {site}, download {family} under its own licence, and give the file (.pkl or "
        ".npz), or the folder that holds it, with --body-model."
    )


def _numbers(value: object, path: Path) -> NDArray[np.float32]:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
        raise InputError(
            f"{path} must hold numbers in {', '.join(_KEYS)}",
            type(value).__name__,
            f"Take the file as it was downloaded from {SMPL_URL} or {SMPLX_URL}.",
        )
    return np.ascontiguousarray(value, np.float32)


def _shape_directions(content: dict[str, object], path: Path) -> NDArray[np.float32]:
    directions = _numbers(content["shapedirs"], path)
    joints = _numbers(content["J_regressor"], path).shape[0]
    if joints == _SMPLX_JOINTS and directions.ndim == 3:
        count = _SHAPES_OF_SMPLX.get(directions.shape[2], directions.shape[2])
        return np.ascontiguousarray(directions[:, :, :count])
    return directions


def _parents(value: object, path: Path) -> NDArray[np.int32]:
    """Rows of parent and own number; the root's parent is 2^32 - 1 or -1."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu" or value.ndim != 2:
        raise InputError(f"{path} must have a kintree_table (2, J)", "none", "Download it again.")
    if len(value) != 2 or value.shape[1] == 0:
        raise InputError(
            f"{path} must have a kintree_table (2, J)", f"{value.shape}", "Download it again."
        )
    numbers = {int(number): joint for joint, number in enumerate(value[1])}
    parents = [numbers.get(int(parent), -1) for parent in value[0]]
    return np.array([-1, *parents[1:]], np.int32)
