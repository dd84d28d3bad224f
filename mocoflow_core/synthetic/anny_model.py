"""The Anny body model (Apache-2.0, its assets CC0) read straight from its installed package.

``anny.Anny()`` parses all of its 1136 shape targets and caches about 850 MB before it answers.
A scene needs one body shape, so only the few targets with a weight are parsed, into Anny's own
data structures: two seconds, no files written, the same vertices.
"""

from __future__ import annotations

import gzip
from collections.abc import Sequence
from pathlib import Path

import anny
import numpy as np
import roma  # type: ignore[import-untyped]
import torch
from anny.models import full_model, model_transforms, retopology
from anny.models.model_data import PHENOTYPE_VARIATIONS, ModelData, ModelMetadata, RigConfig
from anny.models.phenotype import make_phenotype_anchors, phenotype_blendshape_weights
from anny.paths import get_anny_root_dir
from anny.utils.mesh_utils import triangulate_faces

from mocoflow_core.synthetic.body_shape import BodyShape

DTYPE = torch.float64

# Folder and file name of the targets of each block; "newborn" has no file of its own. Local
# changes, lengths and girths of their own, lie in the folder of their part of the body.
_TARGET_FILES = {
    "universal": "macrodetails/universal-{}.target.gz",
    "race": "macrodetails/{}.target.gz",
    "height": "macrodetails/height/{}.target.gz",
    "proportions": "macrodetails/proportions/{}.target.gz",
    "breast": "breast/{}.target.gz",
    "local_change": "*/{}.target.gz",
}
_PHENOTYPE_BLOCKS = ("universal", "race", "height", "proportions", "breast")


def load_anny(shape: BodyShape) -> anny.Anny:
    """Anny restricted to one body shape, float64, plain linear blend skinning.

    Its rest pose stands upright along +z, faces -y, left hand at +x, metres; joint rotations
    (``pose_parameterization="local-ref"``) turn about these same axes.
    """
    targets, _ = phenotype_targets([shape])
    return anny_with_targets(targets)


def anny_with_targets(targets: dict[str, torch.Tensor]) -> anny.Anny:
    """Anny restricted to some of its shape targets, label -> variation mask."""
    rig = RigConfig.from_string("anny")
    data = full_model._filter_rig(
        _read_model_data(rig, targets), rig.bones_to_remove, rig.subtree_root
    )
    data = model_transforms.remove_unattached_vertices(model_transforms.edit_mesh(data))
    data = model_transforms.triangulate(model_transforms.compact_skinning_weights(data))
    data = model_transforms.apply_anny_cached_orientation(data)
    return anny.Anny.from_model_data(
        data,
        skinning_method="lbs",
        pose_parameterization="local-ref",
        bone_orientation="cached",
        root_identity_orientation=False,
        phenotypes="default",
    )


def read_topology(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) on Anny's template, metres, and triangles (F, 3) of another topology."""
    vertices, faces = retopology._load_target_topology_mesh(name)
    return vertices.numpy(), np.array(triangulate_faces(vertices, faces))


def phenotype_targets(
    shapes: Sequence[BodyShape],
) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
    """Label -> variation mask of each target that some shape gives a weight; weights (S, N)."""
    variations = [name for names in PHENOTYPE_VARIATIONS.values() for name in names]
    labels = [
        label
        for label in _orientation_labels()
        if label.split(":")[0] in _PHENOTYPE_BLOCKS and "newborn" not in label
    ]
    masks = torch.zeros((len(labels), len(variations)), dtype=DTYPE)
    for row, label in enumerate(labels):
        for name in label.split(":")[1].split("-"):
            masks[row, variations.index(name)] = 1
    weights = phenotype_blendshape_weights(
        torch.tensor([list(shape.model_dump().values()) for shape in shapes], dtype=DTYPE),
        list(BodyShape.model_fields),
        make_phenotype_anchors(DTYPE),
        masks,
        extrapolate=False,
    )
    # An anchor such as 2/3 is met up to rounding: its neighbour's 1e-16 is no target to read.
    needed = torch.nonzero((weights > 1e-9).any(dim=0))[:, 0].tolist()
    return {labels[i]: masks[i] for i in needed}, weights[:, needed]


def _orientation_labels() -> list[str]:
    path = get_anny_root_dir() / "data/cached/anny.pth"
    return [str(label) for label in torch.load(path, weights_only=True)["blendshape_labels"]]


def _read_target(label: str, vertex_count: int) -> torch.Tensor:
    block, name = label.split(":")
    folder = Path(get_anny_root_dir()) / "data/mpfb2/targets"
    (path,) = folder.glob(_TARGET_FILES[block].format(name))
    with gzip.open(path, "rt") as file:
        rows = np.array(file.read().split(), dtype=np.float64).reshape(-1, 4)
    offsets = torch.zeros((vertex_count, 3), dtype=DTYPE)
    offsets[torch.from_numpy(rows[:, 0].astype(np.int64))] = torch.from_numpy(rows[:, 1:])
    return offsets


def _read_model_data(rig: RigConfig, targets: dict[str, torch.Tensor]) -> ModelData:
    """What ``anny.models.full_model.load_data`` builds, with the given targets alone."""
    # Anny's files are y-up decimetres; its world is z-up metres.
    world = roma.Linear(0.1 * roma.euler_to_rotmat("X", [90], degrees=True, dtype=DTYPE))[None]
    mesh = full_model.load_mesh(eyes=True, tongue=False, world_transformation=world, dtype=DTYPE)
    vertices = mesh.template_vertices
    blendshapes = torch.stack(
        [world.apply(_read_target(label, len(vertices))) for label in targets]
    )
    rig_filename, weights_filename = rig.resolve_filenames()
    bones = full_model.load_rig(
        rig_filename=rig_filename,
        weights_filename=weights_filename,
        groups=mesh.groups,
        template_vertices=vertices,
        blendshapes=blendshapes,
        dtype=DTYPE,
    )
    return ModelData(
        metadata=ModelMetadata(
            bone_parents=bones.bone_parents,
            bone_labels=bones.bone_labels,
            blendshape_labels=list(targets),
        ),
        template_vertices=vertices,
        faces=mesh.faces,
        texture_coordinates=mesh.texture_coordinates,
        face_texture_coordinate_indices=mesh.face_texture_coordinate_indices,
        blendshapes=blendshapes,
        stacked_phenotype_blend_shapes_mask=torch.stack(list(targets.values())),
        template_bone_heads=bones.template_bone_heads,
        bone_heads_blendshapes=bones.bone_heads_blendshapes,
        vertex_bone_weights=bones.vertex_bone_weights,
        vertex_bone_indices=bones.vertex_bone_indices,
        base_mesh_vertex_indices=torch.arange(len(vertices)),
        template_bone_tails=bones.template_bone_tails,
        bone_tails_blendshapes=bones.bone_tails_blendshapes,
        bone_rolls_rotmat=bones.bone_rolls_rotmat,
    )
