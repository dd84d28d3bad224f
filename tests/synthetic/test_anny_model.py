from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocoflow_core.synthetic.body_shape import BodyShape
from mocoflow_core.synthetic.motions import Motion
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.ray_caster import RayCaster


def test_the_light_path_gives_the_vertices_of_the_whole_model():
    # Computed once with anny.Anny(skinning_method="lbs") of anny 0.6.2, which takes a minute.
    expected = {
        0: (0.0327535, -0.1685162, 0.7164974),
        4000: (-0.0558301, 0.0533006, 0.2491215),
        8000: (0.0800489, -0.1230414, 0.7298213),
        12000: (0.1013041, -0.0565231, 0.7456122),
    }
    person = Person.load(BodyShape(weight=0.6, height=0.4))
    joints = {
        "upperarm01.L": Rotation.from_rotvec([[0.3, 0.2, -0.1]]),
        "spine03": Rotation.from_rotvec([[0.1, 0.0, 0.4]]),
        "lowerleg01.R": Rotation.from_rotvec([[0.5, 0.0, 0.0]]),
    }
    motion = Motion(Rotation.identity(1), person.bone_head("root")[None], joints)
    posed = person.pose(motion)[0]
    base = person.anny.base_mesh_vertex_indices.tolist()
    for index, position in expected.items():
        assert posed[base.index(index)] == pytest.approx(position, abs=1e-6)


def test_the_rest_pose_stands_upright_looks_along_minus_y_and_has_its_left_at_plus_x(person):
    keypoints = person.keypoint_regressor @ person.rest_vertices
    nose, left_ear, left_wrist, right_wrist = keypoints[[0, 3, 9, 10]]
    ankles = keypoints[[15, 16]].mean(axis=0)
    assert nose[1] < left_ear[1] - 0.05
    assert left_wrist[0] > 0.3 > -0.3 > right_wrist[0]
    assert nose[2] - ankles[2] > 1.4


def test_the_outer_surface_can_be_seen_from_outside(person):
    vertices, faces = person.rest_vertices.astype(np.float32), person.outer_faces
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    starts = corners.mean(axis=1) + 1e-4 * normals
    caster = RayCaster(vertices, faces)
    seen = np.zeros(len(faces), bool)
    for direction in np.random.default_rng(0).standard_normal((60, 3)).astype(np.float32):
        free = ~caster.occluded(starts, np.broadcast_to(direction, starts.shape))
        seen |= free & (normals @ direction > 0)
    # Nostrils, ears and the inside of the lips remain.
    assert seen.mean() > 0.95
    assert len(faces) < len(person.anny.faces)
