"""A body that moves as it likes, seen exactly."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mocoflow_core.body.fit.fittable_body import FittableBody
from mocoflow_core.body.fit.freedom import FREEDOM
from mocoflow_core.body.fit.posed_body import BodyPose, PosedBody
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.geometry.camera import Camera

FPS = 12.0
BODY = FittableBody.load()
# From the rest pose's axes to those of a camera that the person faces.
FACING = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def made_camera(R=None, t=None):
    K = np.array([[300.0, 0, 64], [0, 300, 64], [0, 0, 1]])
    return Camera(
        "made", 128, 128, K, np.eye(3) if R is None else R, np.zeros(3) if t is None else t
    )


def made_pose(frames=8, seed=3):
    """Smoothly bent limbs, half a turn, a step aside, a shape that is not the mean one."""
    random = np.random.default_rng(seed)
    times = np.linspace(0, 1, frames)[:, None]
    wave = np.sin(2 * np.pi * (times * 0.7 + random.random(len(FREEDOM.joint))))
    angles = (FREEDOM.usual + 0.4 * FREEDOM.spread * wave).clip(FREEDOM.least, FREEDOM.most)
    turn = Rotation.from_rotvec(np.pi * times * [0, 0, 1] + [0, 0, 0.4]).as_matrix()
    places = np.concatenate([0.3 * times, 0.1 * times, 4.5 + 0.2 * times], axis=1)
    shape = np.zeros(BODY.shape_count)
    shape[1:5] = 0.5 * random.standard_normal(4)
    return BodyPose(places, FACING @ turn, angles, shape, np.zeros(len(BODY.parents)))


def keypoints_of(pose):
    """(T, 17, 3) in the camera's axes."""
    return BODY.regressor[:17] @ PosedBody.of(BODY, pose).vertices()


def seen(keypoints, camera):
    """Sightings of exact keypoints (T, 17, 3) in world metres."""
    return Sightings.of(camera.project(keypoints), np.ones(keypoints.shape[:2]))
