"""Keypoints that were detected elsewhere, read from files."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_file
from mocoflow_core.perception.overlap import most_overlapping
from mocoflow_core.perception.person import COCO17, Boxes, Keypoints, Picture

ADVICE = "Give the alphapose-results.json of a COCO or Halpe model."
# Halpe's 26 and the whole-body formats begin with the points of ``COCO17`` in their order.
POINTS = (17, 26, 68, 133, 136)


class AlphaPoseFile:
    """All persons of ``alphapose-results.json``, by the number in the picture's name."""

    def __init__(self, path: Path) -> None:
        """Raises InputError for another file."""
        self.name = f"AlphaPose file {path.name}"
        self.digest = digest_file(_existing(path))
        self._persons: dict[int, list[tuple[NDArray[np.float32], Keypoints]]] = {}
        for number, entry in enumerate(_entries(path)):
            try:
                frame, person = _frame(str(entry["image_id"])), _keypoints(entry["keypoints"])
                box = _box(entry, person)
            except (KeyError, OverflowError, TypeError, ValueError) as error:
                raise InputError(
                    f"{path} as AlphaPose results", f"entry {number} ({error})", ADVICE
                ) from error
            self._persons.setdefault(frame, []).append((box, person))

    @property
    def frames(self) -> list[int]:
        """Numbers of the pictures with at least one person, ascending."""
        return sorted(self._persons)

    def persons(self, frame: int) -> list[tuple[NDArray[np.float32], Keypoints]]:
        """Boxes (4,) and poses of a picture, most confident first."""
        return sorted(self._persons.get(frame, []), key=lambda person: -_mean(person[1]))

    def at(self, frames: Sequence[int]) -> FileDetector:
        """What the file says of pictures with these numbers, in this order."""
        return FileDetector(self, tuple(frames))


class FileDetector:
    """A ``PersonDetector`` and ``KeypointDetector`` that looks its answers up."""

    def __init__(self, file: AlphaPoseFile, frames: tuple[int, ...]) -> None:
        self.name = file.name
        self.digest = file.digest
        self._persons = [file.persons(frame) for frame in frames]

    def boxes(self, images: Sequence[Picture]) -> list[Boxes]:
        """Persons of each picture; confidences are the means over the points."""
        self._require_as_many(len(images))
        return [
            Boxes(
                np.array([box for box, _ in persons], np.float32).reshape(-1, 4),
                np.array([_mean(pose) for _, pose in persons], np.float32),
            )
            for persons in self._persons
        ]

    def keypoints(
        self, images: Sequence[Picture], boxes: Sequence[NDArray[np.floating]]
    ) -> list[Keypoints | None]:
        """The pose whose box overlaps the asked one most; None where none does."""
        self._require_as_many(len(images))
        return [_nearest(found, box) for found, box in zip(self._persons, boxes, strict=True)]

    def _require_as_many(self, count: int) -> None:
        if count != len(self._persons):
            raise InputError(f"{len(self._persons)} pictures", str(count), "Ask for all of them.")


def _nearest(
    persons: Sequence[tuple[NDArray[np.float32], Keypoints]], box: NDArray[np.floating]
) -> Keypoints | None:
    boxes = np.array([other for other, _ in persons], np.float32).reshape(-1, 4)
    row = most_overlapping(box, boxes)
    return None if row is None else persons[row][1]


def _existing(path: Path) -> Path:
    if not path.is_file():
        raise InputError("AlphaPose results", f"no file {path}", ADVICE)
    return path


def _entries(path: Path) -> list[Mapping[str, Any]]:
    try:
        content = json.loads(path.read_text())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} as JSON", str(error), ADVICE) from error
    if not isinstance(content, list):
        raise InputError(f"{path} as AlphaPose results, a list", type(content).__name__, ADVICE)
    return content


def _frame(image: str) -> int:
    """The last number of a picture's name: ``out0000012.png`` is 12."""
    numbers = re.findall(r"\d+", Path(image).stem)
    if not numbers:
        raise ValueError(f"no number in {image!r}")
    return int(numbers[-1])


def _keypoints(values: Sequence[float]) -> Keypoints:
    """The first 17 points; a confidence above 1, which real files hold, counts as 1."""
    points = np.asarray(values, np.float32).reshape(-1, 3)
    if len(points) not in POINTS:
        raise ValueError(f"{len(points)} points where one of {POINTS} was expected")
    if not np.isfinite(points).all():
        raise ValueError("keypoints that are not finite")
    chosen = points[: len(COCO17)]
    # AlphaPose counts the middle of the first pixel as 0.
    return Keypoints(chosen[:, :2] + np.float32(0.5), np.clip(chosen[:, 2], 0.0, 1.0))


def _box(entry: Mapping[str, Any], person: Keypoints) -> NDArray[np.float32]:
    """The stored x, y, width, height as corners, or the box of the points."""
    if "box" in entry:
        x, y, width, height = (float(value) for value in entry["box"])
        if not np.isfinite([x, y, width, height]).all():
            raise ValueError("a box that is not finite")
        return np.array([x, y, x + width, y + height], np.float32)
    return np.concatenate([person.places.min(axis=0), person.places.max(axis=0)])


def _mean(pose: Keypoints) -> float:
    return float(pose.confidence.mean())
