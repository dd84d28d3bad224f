"""Anny's adults as a linear family of bodies: what ``body.fit`` fits.

Bodies are sampled over phenotypes and over lengths and girths of their own, in Anny's reference
pose; the family is their principal components. ``python -m mocoflow_core.synthetic.body_family
PATH`` writes the file that comes with ``body.fit``; half a minute.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import torch
from anny import Anny
from anny.models.rigged_model import RiggedModelWithLinearBlendShapes
from numpy.typing import NDArray

from mocoflow_core.body.fit.fittable_body import JOINTS, FittableBody
from mocoflow_core.synthetic.anny_model import DTYPE, anny_with_targets, phenotype_targets
from mocoflow_core.synthetic.body_shape import BodyShape
from mocoflow_core.synthetic.mesh_estimate import COARSE_TOPOLOGY
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.topology import Topology, coarse_topology

Array = NDArray[np.float64]

# Lengths and girths that differ between people of one phenotype; a fifth is about 5 %.
_MEASURES = (
    *("upperarm-length", "lowerarm-length", "upperleg-height", "lowerleg-height"),
    *("shoulder-dist", "napetowaist-dist", "waisttohip-dist", "neck-height"),
    *("hips-circ", "waist-circ"),
)
_MEASURE_SPREAD = 0.2
# Anny's middle height is 1.91 m for a man and 1.77 m for a woman; people are 1.77 +- 0.07 m and
# 1.64 +- 0.065 m tall.
_HEIGHT, _HEIGHT_SPREAD = 0.375, 0.065
_SPREAD = 0.17
_SAMPLES = 400
_COMPONENTS = 16


def body_family(samples: int = _SAMPLES, components: int = _COMPONENTS) -> FittableBody:
    """Adults of both genders with the 1229 vertices of Anny's coarse topology."""
    random = np.random.default_rng(0)
    shapes = [_adult(random) for _ in range(samples)]
    targets, shares = phenotype_targets(shapes)
    local = [f"local_change:measure-{name}-{way}" for name in _MEASURES for way in ("incr", "decr")]
    mask = torch.zeros(len(next(iter(targets.values()))), dtype=DTYPE)
    anny = anny_with_targets(targets | dict.fromkeys(local, mask))
    measures = _MEASURE_SPREAD * random.standard_normal((samples, len(_MEASURES)))
    both_ways = np.stack([measures, -measures], axis=-1).clip(0, 1).reshape(samples, -1)
    coefficients = torch.cat([shares, torch.from_numpy(both_ways)], dim=1)
    person = Person(anny, BodyShape())
    topology = coarse_topology(person, COARSE_TOPOLOGY)
    vertices, heads = _rest_bodies(anny, coefficients, topology)
    weights = _part_weights(anny, topology)
    return _family(shapes, vertices, heads, weights, _parents(anny), topology, components)


def _adult(random: np.random.Generator) -> BodyShape:
    gender = float(random.beta(0.3, 0.3))
    middle = {name: 0.5 + _SPREAD * random.standard_normal() for name in ("muscle", "weight")}
    return BodyShape(
        gender=gender,
        age=float(2 / 3 + random.beta(1, 2) / 3),
        height=_HEIGHT + _HEIGHT_SPREAD * float(random.standard_normal()),
        proportions=float(np.clip(0.5 + _SPREAD * random.standard_normal(), 0, 1)),
        **{name: float(np.clip(value, 0, 1)) for name, value in middle.items()},
    )


def _rest_bodies(anny: Anny, coefficients: torch.Tensor, topology: Topology) -> tuple[Array, Array]:
    """Vertices (S, V, 3) and joints (S, J, 3) in the reference pose."""
    bones = [anny.bone_labels.index(joint) for joint in JOINTS]
    vertices, heads = [], []
    with torch.no_grad():
        for row in coefficients:
            posed = RiggedModelWithLinearBlendShapes.forward(anny, None, row[None])
            vertices.append(topology.mixture @ posed["vertices"][0].numpy())
            heads.append(posed["bone_poses"][0, bones, :3, 3].numpy())
    return np.stack(vertices), np.stack(heads)


def _part_weights(anny: Anny, topology: Topology) -> Array:
    """(V, J): what each of ``JOINTS`` moves, with all bones below it that do not turn."""
    part: list[int] = []
    for bone, parent in zip(anny.bone_labels, anny.bone_parents, strict=True):
        part.append(JOINTS.index(bone) if bone in JOINTS else part[parent])
    dense = topology.mixture @ anny.dense_vertex_bone_weights.numpy()
    weights = np.stack([dense[:, np.array(part) == j].sum(1) for j in range(len(JOINTS))], -1)
    return weights / weights.sum(1, keepdims=True)


def _family(
    shapes: list[BodyShape],
    vertices: Array,
    heads: Array,
    weights: Array,
    parents: NDArray[np.int64],
    topology: Topology,
    components: int,
) -> FittableBody:
    count = vertices.shape[1]
    bodies = np.concatenate([vertices, heads], axis=1).reshape(len(shapes), -1)
    mean = bodies.mean(0)
    scores, sizes, basis = np.linalg.svd(bodies - mean, full_matrices=False)
    spread = sizes[:components, None] / np.sqrt(len(shapes))
    basis = (spread * basis[:components]).reshape(components, -1, 3)
    scores = np.sqrt(len(shapes)) * scores[:, :components]
    middle = mean.reshape(-1, 3)
    top, bottom = middle[:count, 2].argmax(), middle[:count, 2].argmin()
    stature = vertices[:, top, 2] - vertices[:, bottom, 2]
    facts = [[s.gender, s.age, s.muscle, s.weight, s.height, s.proportions] for s in shapes]
    known = np.concatenate([stature[:, None], facts], axis=1)
    readings, *_ = np.linalg.lstsq(np.column_stack([scores, np.ones(len(scores))]), known)
    return FittableBody(
        vertices=middle[:count],
        vertex_basis=basis[:, :count],
        heads=middle[count:],
        head_basis=basis[:, count:],
        weights=weights,
        parents=parents,
        faces=topology.faces,
        regressor=np.concatenate([topology.keypoint_regressor, _feet(middle[:count], weights)]),
        readings=readings.T,
    )


def _parents(anny: Anny) -> NDArray[np.int64]:
    """The joints' tree: bones that do not turn are skipped."""
    parents = []
    for joint in JOINTS:
        bone = anny.bone_parents[anny.bone_labels.index(joint)]
        while bone > 0 and anny.bone_labels[bone] not in JOINTS:
            bone = anny.bone_parents[bone]
        parents.append(JOINTS.index(anny.bone_labels[max(bone, 0)]))
    return np.array(parents)


def _feet(vertices: Array, weights: Array, points: int = 4) -> Array:
    """(4, V) heels and tips of the toes: the feet's last vertices behind and in front."""
    rows = np.zeros((4, len(vertices)))
    for row, (joint, way) in enumerate(
        [("foot.L", 1), ("foot.R", 1), ("foot.L", -1), ("foot.R", -1)]
    ):
        far = np.where(weights[:, JOINTS.index(joint)] > 0.5, way * vertices[:, 1], -np.inf)
        rows[row, np.argsort(-far)[:points]] = 1 / points
    return rows


if __name__ == "__main__":
    body_family().save(Path(sys.argv[1]))
