"""Laws of choosing the canonical frame."""

from __future__ import annotations

import numpy as np

from mocoflow_core.planning.canonical_frame import closeness
from tests.capsule_person import capsule_person


def test_the_more_the_limbs_are_spread_the_smaller_the_closeness():
    # A negative swing lifts the arms away from the body, a positive one presses them to it.
    swings = [-0.6, -0.3, 0.0, 0.3, 0.6]
    values = closeness(capsule_person([0] * 5, swings, np.zeros((5, 3))))
    assert np.all(np.diff(values) > 0)


def test_turning_and_walking_change_nothing():
    bodies = capsule_person([0, 1, 2], [0, 0, 0], [[0, 0, 0], [1, 2, 0], [5, 5, 5]])
    assert np.ptp(closeness(bodies)) < 1e-4 * closeness(bodies).mean()
