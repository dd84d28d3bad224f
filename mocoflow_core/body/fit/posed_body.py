"""The body in its poses, and how its points move with every unknown, exactly.

Unknowns of a frame: the root joint's place (3), the root's rotation (3, about the camera's axes),
then one angle for each axis of ``FREEDOM``. Unknowns shared by all frames: the shape, and how far
clothes stand off each part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mocoflow_core.body.fit.fittable_body import FittableBody
from mocoflow_core.body.fit.freedom import FREEDOM

Array = NDArray[np.float64]

ROOT = 6
UNKNOWNS = ROOT + len(FREEDOM.joint)
# The joint of each rotation unknown.
_JOINT_OF = np.concatenate([np.zeros(3, np.int64), FREEDOM.joint])


@dataclass(frozen=True, eq=False)
class BodyPose:
    """Camera axes (x right, y down, z forward), metres, radians."""

    places: Array  # (T, 3) of the root joint
    rotations: Array  # (T, 3, 3) rest pose -> camera
    angles: Array  # (T, A) about ``FREEDOM``'s axes
    shape: Array  # (C,)
    clothes: Array  # (J,)

    def moved(self, step: Array, shared: Array) -> BodyPose:
        """After a step (T, UNKNOWNS) of the frames' unknowns and (C + J,) of the shared ones."""
        turn = Rotation.from_rotvec(step[:, 3:ROOT]).as_matrix()
        return BodyPose(
            self.places + step[:, :3],
            turn @ self.rotations,
            self.angles + step[:, ROOT:],
            self.shape + shared[: len(self.shape)],
            self.clothes + shared[len(self.shape) :],
        )

    def frames(self, rows: slice | NDArray[np.int64]) -> BodyPose:
        """Only the given frames."""
        return replace(
            self,
            places=self.places[rows],
            rotations=self.rotations[rows],
            angles=self.angles[rows],
        )


@dataclass(frozen=True, eq=False)
class PosedBody:
    """The joints of T frames; ``R x + b`` takes rest points of a part to the camera's axes."""

    body: FittableBody
    pose: BodyPose
    turns: Array  # (T, J, 3, 3)
    joints: Array  # (T, J, 3) where the joints are
    axes: Array  # (T, 3 + A, 3) about which each rotation unknown turns, camera axes

    @classmethod
    def of(cls, body: FittableBody, pose: BodyPose) -> PosedBody:
        heads, parents = body.rest_heads(pose.shape), body.parents
        vectors = FREEDOM.rotation_vectors(pose.angles)
        count = vectors.shape[:2]
        local = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*count, 3, 3)
        turns, joints = np.empty((*count, 3, 3)), np.empty((*count, 3))
        turns[:, 0], joints[:, 0] = pose.rotations, pose.places
        for joint in range(1, count[1]):
            above = parents[joint]
            turns[:, joint] = turns[:, above] @ local[:, joint]
            bone = heads[joint] - heads[above]
            joints[:, joint] = joints[:, above] + turns[:, above] @ bone
        # A small change of a rotation vector turns about J dv, in the parent's axes.
        frames = turns[:, parents] @ _left_jacobians(vectors)
        axes = (frames[:, FREEDOM.joint] @ FREEDOM.axis[:, :, None])[..., 0]
        root = np.broadcast_to(np.eye(3), (count[0], 3, 3))
        return cls(body, pose, turns, joints, np.concatenate([root, axes], axis=1))

    @cached_property
    def shifts(self) -> Array:
        """(T, J, 3): ``b`` of each part."""
        return self.joints - (self.turns @ self._heads[:, :, None])[..., 0]

    @cached_property
    def _heads(self) -> Array:
        return self.body.rest_heads(self.pose.shape)

    @cached_property
    def shift_basis(self) -> Array:
        """(T, J, C, 3): how the shifts grow with the shape."""
        basis, parents = np.moveaxis(self.body.head_basis, 0, 1), self.body.parents
        moved = np.zeros((*self.joints.shape[:2], basis.shape[1], 3))
        for joint in range(1, len(parents)):
            above = parents[joint]
            bones = (basis[joint] - basis[above]) @ np.swapaxes(self.turns[:, above], 1, 2)
            moved[:, joint] = moved[:, above] + bones
        return moved - basis @ np.swapaxes(self.turns, 2, 3)

    def vertices(self) -> Array:
        """(T, V, 3)."""
        rest, weights = self.body.rest_vertices(self.pose.shape), self.body.weights
        transforms = np.concatenate([self.turns, self.shifts[..., None]], axis=-1)
        blended = (weights @ transforms.reshape(*transforms.shape[:2], 12)).reshape(
            len(transforms), -1, 3, 4
        )
        return (blended[..., :3] @ rest[:, :, None])[..., 0] + blended[..., 3]

    def points(self, points: RestPoints) -> Array:
        """Places (T, N, 3)."""
        return points.parts(self).sum(2)

    def derivatives(self, points: RestPoints) -> tuple[Array, Array, Array]:
        """Places (T, N, 3), by the frame's unknowns (T, N, 3, UNKNOWNS), by shape (T, N, 3, C)."""
        parts = points.parts(self)
        by_frame = np.zeros((*parts.shape[:2], 3, UNKNOWNS))
        # Everything below a joint turns about it.
        below = np.swapaxes(np.swapaxes(parts, 2, 3) @ self.body.below, 2, 3)
        carried = points.mass @ self.body.below
        arms = below - carried[..., None] * self.joints[:, None]
        by_frame[..., :3] = carried[..., :1, None] * np.eye(3)
        by_frame[..., 3:] = np.swapaxes(_cross(self.axes[:, None], arms[:, :, _JOINT_OF]), 2, 3)
        return parts.sum(2), by_frame, points.by_shape(self)


class RestPoints(Protocol):
    """Points that joints carry: N of each frame, or the same N in all."""

    @property
    def mass(self) -> Array:
        """(..., N, J) share of each joint."""

    def parts(self, posed: PosedBody) -> Array:
        """(T, N, J, 3): what each joint contributes to the places."""

    def by_shape(self, posed: PosedBody) -> Array:
        """(T, N, 3, C): how the places move with the shape."""


@dataclass(frozen=True, eq=False)
class Mixtures:
    """Weighted sums of many vertices, such as keypoints.

    Linear blend skinning moves them like the sums of their weights, and of their weighted rest
    places, over each joint; nothing else of the mesh is needed.
    """

    mass: Array  # (N, J)
    moment: Array  # (N, J, 3) metres
    basis: Array  # (N, J, C, 3) how the moment grows with the shape

    @classmethod
    def of(cls, body: FittableBody, mixture: Array, offsets: Array | None = None) -> Mixtures:
        """Mixtures (N, V) of vertices, in the mean shape.

        Offsets (N, 3) in rest axes are carried by the part that carries most of the point.
        """
        count = body.weights.shape[1]
        spread = (mixture[:, None, :] * body.weights.T).reshape(-1, mixture.shape[1])
        size = (len(mixture), count)
        moment = (spread @ body.vertices).reshape(*size, 3)
        basis = np.moveaxis(spread @ body.vertex_basis, 0, 1)
        mass = spread.sum(1).reshape(size)
        if offsets is not None:
            moment[np.arange(len(mixture)), mass.argmax(1)] += offsets
        return cls(mass, moment, basis.reshape(*size, -1, 3))

    def shaped(self, shape: Array) -> Mixtures:
        """The same in another shape (C,), given the mean's."""
        return replace(self, moment=self.moment + shape @ self.basis)

    def parts(self, posed: PosedBody) -> Array:
        turned = (posed.turns[:, None] @ self.moment[..., None])[..., 0]
        return turned + self.mass[..., None] * posed.shifts[:, None]

    def by_shape(self, posed: PosedBody) -> Array:
        turned = self.basis @ np.swapaxes(posed.turns, 2, 3)[:, None]
        moved = turned + self.mass[..., None, None] * posed.shift_basis[:, None]
        return np.swapaxes(moved.sum(2), 2, 3)


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points on the skin, others in each frame."""

    mass: Array  # (T, N, J) skinning weights
    rest: Array  # (T, N, 3)
    basis: Array  # (T, N, C, 3)

    @classmethod
    def middles(cls, body: FittableBody, edges: NDArray[np.int64], shape: Array) -> SkinPoints:
        """Middles of edges (T, N, 2), pairs of vertices."""
        basis = np.moveaxis(body.vertex_basis, 0, 1)
        rest = body.rest_vertices(shape)
        mean = [a[edges[..., 0]] + a[edges[..., 1]] for a in (body.weights, rest, basis)]
        return cls(*(0.5 * both for both in mean))

    def parts(self, posed: PosedBody) -> Array:
        turned = (posed.turns[:, None] @ self.rest[:, :, None, :, None])[..., 0]
        return self.mass[..., None] * (turned + posed.shifts[:, None])

    def by_shape(self, posed: PosedBody) -> Array:
        frames, joints = posed.joints.shape[:2]
        turns = (self.mass @ posed.turns.reshape(frames, joints, 9)).reshape(frames, -1, 3, 3)
        shifts = self.mass @ posed.shift_basis.reshape(frames, joints, -1)
        moved = self.basis @ np.swapaxes(turns, 2, 3)
        return np.swapaxes(moved + shifts.reshape(moved.shape), 2, 3)


def _cross(a: Array, b: Array) -> Array:
    # numpy.cross takes four times as long.
    first, second = a[..., [1, 2, 0]], a[..., [2, 0, 1]]
    return first * b[..., [2, 0, 1]] - second * b[..., [1, 2, 0]]


def _left_jacobians(vectors: Array) -> Array:
    """(..., 3, 3) of rotation vectors: ``exp(v + dv) = exp(J dv) exp(v)``."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*vectors.shape, 3)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) + first * cross + second * cross @ cross
