import numpy as np
import pytest
import torch

from mocoflow_core.body.fit.fittable_body import JOINTS, FittableBody
from mocoflow_core.body.fit.freedom import FREEDOM
from mocoflow_core.body.fit.posed_body import BodyPose, PosedBody
from mocoflow_core.synthetic.mesh_estimate import COARSE_TOPOLOGY
from mocoflow_core.synthetic.topology import coarse_topology

BODY = FittableBody.load()


@pytest.fixture(scope="module")
def topology(person):
    return coarse_topology(person, COARSE_TOPOLOGY)


@pytest.fixture(scope="module")
def shape(person, topology):
    """The coefficients nearest to the person's own shape."""
    rest = topology.vertices(person.rest_vertices[None])[0]
    basis = BODY.vertex_basis.reshape(BODY.shape_count, -1)
    return np.linalg.lstsq(basis.T, (rest - BODY.vertices).ravel())[0]


def test_the_family_holds_anny_s_adults(person, topology, shape):
    rest = topology.vertices(person.rest_vertices[None])[0]
    assert np.linalg.norm(BODY.rest_vertices(shape) - rest, axis=1).mean() < 0.003
    assert BODY.reading("stature_m", shape) == pytest.approx(np.ptp(rest[:, 2]), abs=0.01)


def test_joints_bend_the_body_as_anny_bends(person, topology, shape):
    angles = np.zeros((1, len(FREEDOM.joint)))
    angles[0] = 0.3 * np.random.default_rng(0).standard_normal(angles.shape[1])
    turns = FREEDOM.rotation_vectors(angles)[0]
    pose = torch.eye(4, dtype=torch.float64).repeat(1, person.anny.bone_count, 1, 1)
    for joint, vector in zip(JOINTS, turns, strict=True):
        matrix = torch.linalg.matrix_exp(_cross_matrix(vector))
        pose[0, person.anny.bone_labels.index(joint), :3, :3] = matrix
    with torch.no_grad():
        posed = person.anny(pose_parameters=pose, phenotype_kwargs=person.shape.model_dump())
    expected = topology.vertices(posed["vertices"].numpy())[0]
    ours = BodyPose(np.zeros((1, 3)), np.eye(3)[None], angles, shape, np.zeros(len(JOINTS)))
    found = PosedBody.of(BODY, ours).vertices()[0]
    assert np.linalg.norm(found - expected, axis=1).mean() < 0.005


def _cross_matrix(vector):
    x, y, z = vector
    return torch.tensor([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]], dtype=torch.float64)
