"""Where detectors see landmarks, relative to the points that Anny calls by the same names.

Measured on 144 renders of Anny by ``benchmarks/landmark_offsets.py``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.fit.fittable_body import LANDMARKS

# BlazePose heavy: metres in the rest axes of the part that carries the landmark (x to the
# person's left, y back, z up).
_BLAZEPOSE = {
    "nose": (0.000, 0.009, 0.015),
    "left_eye": (-0.004, 0.014, 0.012),
    "right_eye": (0.004, 0.014, 0.012),
    "left_ear": (-0.020, -0.024, 0.013),
    "right_ear": (0.020, -0.024, 0.013),
    "left_shoulder": (0.000, -0.002, 0.003),
    "right_shoulder": (-0.000, -0.002, 0.003),
    "left_elbow": (-0.003, -0.005, -0.002),
    "right_elbow": (0.003, -0.005, -0.002),
    "left_wrist": (-0.003, -0.005, -0.002),
    "right_wrist": (0.003, -0.005, -0.002),
    "left_hip": (0.005, 0.000, 0.004),
    "right_hip": (-0.005, 0.000, 0.004),
    "left_knee": (-0.006, -0.001, 0.010),
    "right_knee": (0.006, -0.001, 0.010),
    "left_ankle": (-0.005, 0.002, 0.016),
    "right_ankle": (0.005, 0.002, 0.016),
    "left_heel": (-0.015, -0.013, 0.018),
    "right_heel": (0.015, -0.013, 0.018),
    "left_toes": (0.003, 0.036, 0.027),
    "right_toes": (-0.003, 0.036, 0.027),
}

BLAZEPOSE_OFFSETS: NDArray[np.float64] = np.array([_BLAZEPOSE[name] for name in LANDMARKS])
