"""What a body estimator would have delivered for a synthetic clip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.motions import Motion
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.topology import body_topology, coarse_topology

COARSE_TOPOLOGY = "notoes_collapse10pc"

# The joints that body estimators solve for; the root's orientation is noisy too.
NOISY_JOINTS = (
    *("spine04", "spine03", "spine02", "neck02", "head"),
    *(
        f"{joint}.{side}"
        for joint in ("clavicle", "upperarm01", "lowerarm01", "wrist")
        for side in "LR"
    ),
    *(f"{joint}.{side}" for joint in ("upperleg01", "lowerleg01", "foot") for side in "LR"),
)

_NOISE_SECONDS = 0.5  # Standard deviation of the smoothing: errors last about a second.


def estimate_meshes(configuration: SyntheticConfig, person: Person, motion: Motion) -> MeshSequence:
    """The estimate in world metres; its root joint errs by the noise of place alone."""
    if configuration.mesh_estimate == "exact":
        topology = body_topology(person)
        vertices = topology.vertices(person.pose(motion))
    else:
        topology = coarse_topology(person, COARSE_TOPOLOGY)
        believed, pose = person, motion
        if configuration.mesh_estimate == "joint_noise":
            pose = with_joint_noise(motion, configuration)
        if configuration.mesh_estimate == "other_shape":
            believed = Person.load(configuration.other_shape)
        vertices = topology.vertices(believed.pose(pose))
    vertices = vertices + place_noise(len(motion), configuration)[:, None]
    return MeshSequence(
        np.arange(len(motion), dtype=np.int32),
        vertices.astype(np.float32),
        topology.faces,
        topology.keypoint_regressor,
    )


def place_noise(count: int, configuration: SyntheticConfig) -> NDArray[np.float64]:
    """Errors of place (T, 3) along a smooth random curve, metres."""
    random = np.random.default_rng([configuration.seed, 78])
    smoothing = _NOISE_SECONDS * configuration.fps
    return _smooth_curve(random, count, configuration.place_noise_m, smoothing)


def with_joint_noise(motion: Motion, configuration: SyntheticConfig) -> Motion:
    """The motion with a smooth rotation error at the root and every joint; the root stays put."""
    random = np.random.default_rng([configuration.seed, 77])
    smoothing = _NOISE_SECONDS * configuration.fps
    errors = [
        _smooth_rotations(random, len(motion), configuration.joint_noise_deg, smoothing)
        for _ in range(len(NOISY_JOINTS) + 1)
    ]
    still = Rotation.identity(len(motion))
    joints = dict(motion.joints)
    for joint, error in zip(NOISY_JOINTS, errors[1:], strict=True):
        joints[joint] = error * joints.get(joint, still)
    return replace(motion, root_rotation=errors[0] * motion.root_rotation, joints=joints)


def _smooth_rotations(
    random: np.random.Generator, count: int, rms_degrees: float, smoothing: float
) -> Rotation:
    """Rotations (T,) along a smooth random curve, their root mean square angle as given."""
    return Rotation.from_rotvec(_smooth_curve(random, count, np.radians(rms_degrees), smoothing))


def _smooth_curve(
    random: np.random.Generator, count: int, rms: float, smoothing: float
) -> NDArray[np.float64]:
    """Vectors (T, 3) of a root mean square length."""
    curve = gaussian_filter1d(random.standard_normal((count, 3)), smoothing, axis=0, mode="reflect")
    return curve * (rms / np.sqrt((curve**2).sum(axis=1).mean()))
