import numpy as np
import pytest

from mocoflow_core.body.fit.posed_body import UNKNOWNS, Mixtures, PosedBody, SkinPoints
from tests.body.fit.made_movement import BODY, made_pose

POSE = made_pose(3)
LANDMARKS = Mixtures.of(BODY, BODY.regressor)
EDGES = np.stack([BODY.faces[row : row + 20, :2] for row in (0, 700, 1400)]).astype(np.int64)


def landmarks(pose):
    return LANDMARKS.shaped(pose.shape)


def middles(pose):
    return SkinPoints.middles(BODY, EDGES, pose.shape)


def test_mixtures_are_those_of_the_skinned_vertices():
    posed = PosedBody.of(BODY, POSE)
    np.testing.assert_allclose(
        posed.points(landmarks(POSE)), BODY.regressor @ posed.vertices(), atol=1e-12
    )


def test_offsets_are_carried_along():
    offsets = np.tile([0.01, 0.02, 0.03], (len(BODY.regressor), 1))
    moved = PosedBody.of(BODY, POSE).points(Mixtures.of(BODY, BODY.regressor, offsets))
    plain = PosedBody.of(BODY, POSE).points(LANDMARKS)
    length = np.linalg.norm(moved - plain, axis=-1)
    np.testing.assert_allclose(length, np.linalg.norm(offsets[0]), atol=1e-12)


@pytest.mark.parametrize("points", [landmarks, middles])
def test_derivatives_are_exact(points):
    def places(frame_step, shared):
        pose = POSE.moved(frame_step, shared)
        return PosedBody.of(BODY, pose).points(points(pose))

    _, by_frame, by_shape = PosedBody.of(BODY, POSE).derivatives(points(POSE))
    none, unshared = np.zeros((3, UNKNOWNS)), np.zeros(BODY.shape_count + len(BODY.parents))
    step = 1e-6
    for unknown in range(UNKNOWNS):
        ahead = none.copy()
        ahead[:, unknown] = step
        slope = (places(ahead, unshared) - places(-ahead, unshared)) / (2 * step)
        np.testing.assert_allclose(by_frame[..., unknown], slope, atol=1e-7)
    for coefficient in range(BODY.shape_count):
        ahead = unshared.copy()
        ahead[coefficient] = step
        slope = (places(none, ahead) - places(none, -ahead)) / (2 * step)
        np.testing.assert_allclose(by_shape[..., coefficient], slope, atol=1e-7)
