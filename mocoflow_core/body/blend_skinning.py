"""Linear blend skinning: a body model takes shapes and poses.

Source: Loper et al., SMPL (2015), eqs. 2-10. Rotations come from ``geometry.se3``, exact at zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.errors import InputError
from mocoflow_core.geometry.se3 import exp_se3
from mocoflow_core.progress import Progress, untold

# Frames are taken in portions whose per-vertex transforms fit into this.
PORTION_BYTES = 64 * 2**20
_TRANSFORM_NUMBERS = 16


def posed_vertices(
    model: SmplModel,
    pose: ArrayLike,
    shape: ArrayLike,
    translation: ArrayLike | None = None,
    offsets: ArrayLike | None = None,
    pose_directions: bool = True,
    progress: Progress = untold,
) -> NDArray[np.floating]:
    """Vertices of the body in each frame.

    Args:
        model: the body model; computed in its precision.
        pose: (T, K, 3) axis-angle in radians or (T, K, 3, 3) rotation matrices, joint 0 first and
            about the pelvis. Joints from K on keep their rest: SMPL-X's hands are flat, its jaw
            shut.
        shape: (S,) or (T, S) coefficients, as many as the model knows or fewer.
        translation: (T, 3) or (3,) metres, added last.
        offsets: (V, 3) metres on the shaped template, before posing; they move no joints.
        pose_directions: whether the pose also corrects the shape (eq. 9). False gives the bodies
            of ZJU-MoCap's first parameter files.

    Returns:
        (T, V, 3) metres, in the model's axes.

    Raises:
        InputError: sizes that do not fit the model, or numbers that are not finite.
    """
    body = _Body.of(model, pose, shape, translation)
    extra = None if offsets is None else _tensor("offsets", offsets, model)
    if extra is not None and extra.shape != (model.vertex_count, 3):
        raise _misfit("offsets", f"({model.vertex_count}, 3)", extra)
    result = np.empty((len(body.rotations), model.vertex_count, 3), model.template.dtype)
    directions = _flat_directions(model) if pose_directions else None
    for portion in _portions(len(result), model):
        result[portion] = _skinned(model, body.frames(portion), extra, directions).numpy()
        progress(min(portion.stop / len(result), 1.0), "posing bodies")
    return result


def posed_joints(
    model: SmplModel, pose: ArrayLike, shape: ArrayLike, translation: ArrayLike | None = None
) -> NDArray[np.floating]:
    """Joint positions (T, J, 3) in metres; arguments and errors as for ``posed_vertices``."""
    body = _Body.of(model, pose, shape, translation)
    _, places = _chain(body.rotations, body.joints(model), model.parents)
    return (places + body.translation[:, None]).numpy()


def rest_joints(model: SmplModel, shape: ArrayLike) -> NDArray[np.floating]:
    """Joint positions (J, 3) at rest for shape (S,), metres; the pelvis comes first."""
    regressor = torch.from_numpy(model.joint_regressor)
    return (regressor @ _shaped(model, _shape("shape", shape, model))[0]).numpy()


@dataclass(frozen=True, eq=False)
class _Body:
    """What is asked for, checked and as tensors: T frames, or one shape for all of them."""

    rotations: Tensor  # (T, J, 3, 3)
    shapes: Tensor  # (T or 1, S)
    translation: Tensor  # (T, 3)

    @classmethod
    def of(
        cls, model: SmplModel, pose: ArrayLike, shape: ArrayLike, translation: ArrayLike | None
    ) -> _Body:
        rotations = _rotations(model, pose)
        frames = len(rotations)
        shapes = _shape("shape", shape, model)
        if len(shapes) not in (1, frames):
            raise _misfit("shape", f"(S,) or ({frames}, S)", shapes)
        moved = _tensor("translation", np.zeros(3) if translation is None else translation, model)
        if moved.shape not in ((3,), (frames, 3)):
            raise _misfit("translation", f"({frames}, 3)", moved)
        return cls(rotations, shapes, moved.expand(frames, 3))

    def frames(self, portion: slice) -> _Body:
        shapes = self.shapes if len(self.shapes) == 1 else self.shapes[portion]
        return _Body(self.rotations[portion], shapes, self.translation[portion])

    def joints(self, model: SmplModel) -> Tensor:
        """Rest joints (T or 1, J, 3), regressed from a shape basis instead of from the bodies."""
        regressor = torch.from_numpy(model.joint_regressor)
        template = regressor @ torch.from_numpy(model.template)
        directions = torch.from_numpy(model.shape_directions[:, :, : self.shapes.shape[1]])
        basis = torch.einsum("jv,vds->jds", regressor, directions)
        return template + torch.einsum("jds,ts->tjd", basis, self.shapes)


def _skinned(
    model: SmplModel, body: _Body, offsets: Tensor | None, directions: Tensor | None
) -> Tensor:
    """Vertices (T, V, 3) of a few frames."""
    rest = _shaped(model, body.shapes)
    if offsets is not None:
        rest = rest + offsets
    if directions is not None:
        turned = body.rotations[:, 1:] - torch.eye(3, dtype=rest.dtype)
        rest = rest + (turned.reshape(len(turned), -1) @ directions).view(len(turned), -1, 3)
    joints = body.joints(model)
    turns, places = _chain(body.rotations, joints, model.parents)
    # A joint's motion takes points at rest: turn about the joint's rest place, then move there.
    moves = places - torch.einsum("tjab,tjb->tja", turns, joints.expand_as(places))
    weights = torch.from_numpy(model.skinning_weights)
    parts = torch.cat([turns, moves[..., None]], -1).flatten(2)
    transforms = (weights @ parts).unflatten(-1, (3, 4))
    turned_rest = (transforms[..., :3] @ rest[..., None])[..., 0]
    return turned_rest + transforms[..., 3] + body.translation[:, None]


def _chain(rotations: Tensor, joints: Tensor, parents: NDArray[np.int32]) -> tuple[Tensor, Tensor]:
    """Global rotations (T, J, 3, 3) and positions (T, J, 3) of the joints."""
    joints = joints.expand(*rotations.shape[:2], 3)
    turns, places = {0: rotations[:, 0]}, {0: joints[:, 0]}
    waiting = list(range(1, len(parents)))
    while waiting:
        joint = next(j for j in waiting if int(parents[j]) in turns)
        parent = int(parents[joint])
        bone = joints[:, joint] - joints[:, parent]
        turns[joint] = turns[parent] @ rotations[:, joint]
        places[joint] = places[parent] + (turns[parent] @ bone[..., None])[..., 0]
        waiting.remove(joint)
    order = range(len(parents))
    return torch.stack([turns[j] for j in order], 1), torch.stack([places[j] for j in order], 1)


def _shaped(model: SmplModel, shapes: Tensor) -> Tensor:
    """Rest vertices (T, V, 3) of shapes (T, S)."""
    directions = torch.from_numpy(model.shape_directions[:, :, : shapes.shape[1]])
    return torch.from_numpy(model.template) + torch.einsum("vds,ts->tvd", directions, shapes)


def _flat_directions(model: SmplModel) -> Tensor:
    """Pose directions (P, 3 V)."""
    count = model.pose_directions.shape[2]
    return torch.from_numpy(model.pose_directions).reshape(-1, count).T.contiguous()


def _rotations(model: SmplModel, pose: ArrayLike) -> Tensor:
    values = _tensor("pose", pose, model)
    joints = values.shape[1] if values.ndim in (3, 4) else 0
    if values.shape[2:] not in ((3,), (3, 3)) or not 1 <= joints <= model.joint_count:
        raise _misfit(
            "pose", f"(T, {model.joint_count}, 3) or (T, {model.joint_count}, 3, 3)", values
        )
    if values.ndim == 3:
        values = exp_se3(torch.cat([values, torch.zeros_like(values)], -1))[0]
    rest = torch.eye(3, dtype=values.dtype).expand(len(values), model.joint_count - joints, 3, 3)
    return torch.cat([values, rest], 1)


def _shape(name: str, shape: ArrayLike, model: SmplModel) -> Tensor:
    values = torch.atleast_2d(_tensor(name, shape, model))
    if values.ndim != 2 or values.shape[1] > model.shape_count:
        raise _misfit(name, f"at most {model.shape_count} coefficients", values)
    return values


def _tensor(name: str, values: ArrayLike, model: SmplModel) -> Tensor:
    array = np.array(values, model.template.dtype)
    if not np.isfinite(array).all():
        raise InputError(f"{name} must be finite", "NaN or infinity", "Repair the estimate.")
    return torch.from_numpy(array)


def _portions(frames: int, model: SmplModel) -> Iterator[slice]:
    size = model.vertex_count * _TRANSFORM_NUMBERS * model.template.itemsize
    step = max(1, PORTION_BYTES // size)
    return (slice(start, start + step) for start in range(0, frames, step))


def _misfit(name: str, required: str, found: Tensor) -> InputError:
    return InputError(
        f"{name} must be {required} for this body model",
        f"{tuple(found.shape)}",
        "Check that the estimate and the model file are of the same kind (SMPL, SMPL-X).",
    )
