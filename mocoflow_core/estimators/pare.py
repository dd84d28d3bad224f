"""PARE's output: VIBE's layout with rotation matrices, and boxes that the network saw whole.

Layout: mkocabas/PARE, pare/core/tester.py.
"""

from __future__ import annotations

from mocoflow_core.estimators import vibe
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.estimate import BodyEstimate
from mocoflow_core.estimators.estimate_file import EstimateFile, people_of

CROP_FACTOR = 1.0


def recognises(stored: EstimateFile) -> bool:
    """Records with a weak perspective camera and rotation matrices or PARE's keypoints."""
    people = people_of(stored.content)
    return bool(people) and all(
        vibe.is_cropped(one) and vibe.has_matrices(one) for one in people.values()
    )


def read(stored: EstimateFile, context: EstimateContext) -> BodyEstimate:
    """One person of PARE's output. Raises InputError without faces."""
    return vibe.read_cropped("PARE", CROP_FACTOR, stored, context)
