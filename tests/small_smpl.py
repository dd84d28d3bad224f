"""Body model files in SMPL's layout, made here: a person of smooth capsules with 24 joints.

Not SMPL: no number of a licensed model is in it. Structure, keys, types and axes are the same (y
up, x to the person's left, facing +z, metres, the pelvis 0.22 m below the origin), and so are the
counts where they are asked for: 6890 vertices and 13776 faces, one closed surface, outward.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.optimize
import scipy.sparse

from tests.python2_pickle import Forged, python2_pickle
from tests.smooth_person import place, surface, to_segment

SMALL, FULL = 1200, 6890
FULL_SMPLX = 10475

# SMPL's order; "l_" and "r_" name the sides.
SMPL_JOINTS = (
    "pelvis l_hip r_hip spine1 l_knee r_knee spine2 l_ankle r_ankle spine3 l_foot r_foot neck "
    "l_collar r_collar head l_shoulder r_shoulder l_elbow r_elbow l_wrist r_wrist l_hand r_hand"
).split()
SMPL_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
# SMPL-X: the first 22 of these, jaw and eyes on the head, 15 finger joints on each wrist.
SMPLX_PARENTS = (
    *SMPL_PARENTS[:22],
    *(15, 15, 15),
    *(
        parent
        for wrist, first in ((20, 25), (21, 40))
        for f in range(5)
        for parent in (wrist, first + 3 * f, first + 3 * f + 1)
    ),
)
_WEIGHT_FALL_M = 0.025


def small_smpl(vertices: int = SMALL) -> dict[str, np.ndarray]:
    """The arrays of an SMPL model under their keys in the file, float64, sparse regressor dense."""
    return _model(_smpl_joints(), SMPL_PARENTS, vertices, shapes=10)


def small_smplx(vertices: int = SMALL) -> dict[str, np.ndarray]:
    """The same of SMPL-X: 55 joints, 300 shapes and 100 expressions, means of the hands."""
    model = _model(_smplx_joints(), SMPLX_PARENTS, vertices, shapes=400)
    return model | {
        "hands_meanl": np.full(45, 0.2),
        "hands_meanr": np.full(45, -0.2),
        "hands_componentsl": np.eye(45),
        "hands_componentsr": np.eye(45),
    }


def write_smpl(path: Path, vertices: int = SMALL, protocol: int = 2) -> dict[str, np.ndarray]:
    """The model as the pickle that is distributed: Python 2, chumpy arrays, a sparse regressor.

    An ending ``.npz`` writes the conversion with the same keys. Returns the arrays.
    """
    model = small_smpl(vertices)
    if path.suffix == ".npz":
        np.savez(path, **model)
        return model
    content = model | {
        "shapedirs": _chumpy(model["shapedirs"]),
        "posedirs": _chumpy(model["posedirs"]),
        "v_template": _chumpy(model["v_template"]),
        "J_regressor": _sparse(model["J_regressor"]),
        "J_regressor_prior": _sparse(model["J_regressor"]),
        "weights_prior": model["weights"],
        "vert_sym_idxs": np.arange(vertices),
        "pose_training_info": {"bla": "blub"},
        "bs_style": "lbs",
        "bs_type": "lrotmin",
        "J": _chumpy(model["J"]),
    }
    path.write_bytes(python2_pickle(content, protocol))
    return model


def write_smplx(path: Path, vertices: int = SMALL) -> dict[str, np.ndarray]:
    """An SMPL-X model as ``.npz``, an object among its arrays as in the original.

    Returns the arrays.
    """
    model = small_smplx(vertices)
    extra = {"joint2num": np.array({"Pelvis": 0, "Jaw": 22}, object)}
    np.savez(path, **model, **extra)
    return model


def _chumpy(array):
    return Forged(
        "chumpy.ch",
        "Ch",
        {"x": array, "_dirty_vars": {"x"}, "_itr": None, "_depends_on_deps": {}},
    )


def _sparse(array):
    matrix = scipy.sparse.csc_matrix(array)
    parts = {name: getattr(matrix, name) for name in ("data", "indices", "indptr")}
    return Forged(
        "scipy.sparse.csc", "csc_matrix", {"_shape": matrix.shape, "maxprint": 50} | parts
    )


def _smpl_joints() -> np.ndarray:
    return np.array([place(name) for name in SMPL_JOINTS], float)


def _smplx_joints() -> np.ndarray:
    head = place("head")
    face = head + np.array([(0, 0, 0.01), (0.03, 0.06, 0.05), (-0.03, 0.06, 0.05)])
    left = [
        (0.75 + 0.025 * joint, 0.22, -0.03 + 0.012 * (finger - 2))
        for finger in range(5)
        for joint in range(3)
    ]
    right = np.array(left) * (-1, 1, 1)
    return np.vstack([_smpl_joints()[:22], face, left, right])


def _model(joints, parents, vertices, shapes) -> dict[str, np.ndarray]:
    template, faces = (array.copy() for array in surface(vertices))
    weights = _weights(template, joints, parents)
    random = np.random.default_rng(0)
    return {
        "v_template": template,
        "f": faces.astype(np.uint32),
        "shapedirs": _shape_directions(template, shapes, random),
        "posedirs": _pose_directions(template, weights, random),
        "J_regressor": _regressor(template, joints),
        "weights": weights,
        "kintree_table": np.array(
            [[2**32 - 1, *parents[1:]], range(len(parents))], np.int64
        ).astype(np.uint32),
        "J": joints,
    }


def _weights(template, joints, parents) -> np.ndarray:
    """Near bones carry a vertex, at most four of them, as in SMPL."""
    gaps = np.full((len(template), len(joints)), np.inf)
    for joint in range(len(joints)):
        children = [c for c, parent in enumerate(parents) if parent == joint]
        ends = [joints[c] for c in children] or [2 * joints[joint] - joints[parents[joint]]]
        for end in ends:
            gaps[:, joint] = np.minimum(gaps[:, joint], to_segment(template, joints[joint], end))
    nearness = np.exp(-(gaps - gaps.min(axis=1, keepdims=True)) / _WEIGHT_FALL_M)
    # A vertex left of the middle plane has nothing to do with the right leg.
    other_side = np.sign(joints[:, 0]) * np.sign(template[:, :1]) < 0
    nearness[other_side & (np.abs(template[:, :1]) > 0.02)] = 0
    np.put_along_axis(nearness, np.argsort(nearness, axis=1)[:, :-4], 0, axis=1)
    return nearness / nearness.sum(axis=1, keepdims=True)


def _regressor(template, joints) -> np.ndarray:
    """Rows that sum to one and give each joint exactly as a mean of vertices around it."""
    rows = np.zeros((len(joints), len(template)))
    for joint, spot in enumerate(joints):
        near = np.argsort(np.linalg.norm(template - spot, axis=1))[: len(template) // 8]
        system = np.vstack([template[near].T, np.ones(len(near))])
        share, _ = scipy.optimize.nnls(system, np.append(spot, 1.0))
        rows[joint, near] = share / share.sum()
    return rows


def _shape_directions(template, count, random) -> np.ndarray:
    """Stature, girth, then ever weaker smooth fields; metres per unit."""
    directions = np.zeros((*template.shape, count))
    directions[:, :, 0] = template * 0.03
    directions[:, :, 1] = template * (0.02, 0, 0.06)
    frequencies = random.normal(0, 3, (count, 3))
    phases, ways = random.uniform(0, 2 * np.pi, count), random.normal(0, 1, (count, 3))
    for number in range(2, count):
        wave = np.sin(template @ frequencies[number] + phases[number])
        directions[:, :, number] = 0.008 / (1 + 0.3 * number) * wave[:, None] * ways[number]
    return directions


def _pose_directions(template, weights, random) -> np.ndarray:
    """Some millimetres around each joint per unit of its R - I."""
    count = 9 * (weights.shape[1] - 1)
    ways = random.normal(0, 0.004, (3, count))
    owner = 1 + np.arange(count) // 9
    near = weights[:, owner] * (1 + np.sin(5 * template[:, :1] + np.arange(count)))
    return near[:, None, :] * ways
