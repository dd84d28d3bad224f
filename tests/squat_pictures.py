"""A real person in real pictures: what a detector of persons cannot be tested without."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from mocoflow_core.capture.frame_source import read_image

FOLDER = Path(__file__).parent / "data" / "squat"
# Landmarks of the mirrored body.
MIRRORED = [0, 4, 5, 6, 1, 2, 3, 8, 7, 10, 9, *(n + 1 if n % 2 else n - 1 for n in range(11, 33))]


def squat_pictures():
    """Three pictures (640, 360, 3) of one person."""
    return [read_image(path) for path in sorted(FOLDER.glob("*.jpg"))]


def squat_landmarks():
    """(3, 33, 2) pixels, of the original runtime."""
    found = json.loads((FOLDER / "landmarks.json").read_text())
    return np.array([found[name] for name in sorted(found, key=int)])


def empty_room():
    """The background of the pictures, roughly: what is left of the person, mirrored over it."""
    picture = squat_pictures()[0].copy()
    picture[:, 40:220] = picture[:, :1]
    return picture
