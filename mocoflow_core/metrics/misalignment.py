"""What the scores say of a photograph that is merely moved or turned: Table 1 of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import cv2
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from mocoflow_core.metrics.crop import bounding_box, crop_around
from mocoflow_core.metrics.psnr import psnr
from mocoflow_core.metrics.score import WHITE, EvaluationConfig, on_white, protocol
from mocoflow_core.metrics.ssim import ssim

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

# The paper's table: pixels of its crop, and degrees.
SHIFTS_PX = (10.0, 20.0, 30.0, 40.0, 50.0)
TURNS_DEG = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
_DIRECTIONS = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))

SCHEMA = pa.schema(
    [
        ("scene", pa.string()),
        ("misplaced", pa.string()),
        ("amount", pa.float64()),
        ("unit", pa.string()),
        ("moved_px", pa.float64()),
        ("metric", pa.string()),
        ("value", pa.float64()),
        ("views", pa.int64()),
        ("protocol", pa.string()),
    ]
)


class Misplacement(NamedTuple):
    """One way of moving a picture: shifted by px of the paper's crop, or turned by degrees."""

    kind: Literal["shifted", "turned"]
    amount: float

    @property
    def unit(self) -> str:
        return "px" if self.kind == "shifted" else "degrees"

    def moved_px(self, scale: float) -> float | None:
        """Pixels of a working picture with ``scale`` of them for one of the paper's crop."""
        return scale * self.amount if self.kind == "shifted" else None


MISPLACEMENTS = (
    *(Misplacement("shifted", px) for px in SHIFTS_PX),
    *(Misplacement("turned", degrees) for degrees in TURNS_DEG),
)


class MisalignmentRow(NamedTuple):
    """One mean over views and directions."""

    scene: str
    misplaced: str
    amount: float
    unit: str
    moved_px: float | None  # of the working picture, where it is shifted
    metric: str
    value: float
    views: int
    protocol: str


def misalignment_rows(
    scene: str,
    views: Sequence[tuple[NDArray[np.uint8], Mask]],
    side: int,
    configuration: EvaluationConfig,
) -> list[MisalignmentRow]:
    """``psnr``, ``ssim`` over the crop and ``psnr_union`` of views against themselves, misplaced.

    Args:
        views: photographs (H, W, 3) with the person's mask (H, W), which has true pixels.
        side: of the crop in pixels, as for the scores. A shift by n px is one by
            ``n * side / crop_reference_px`` here: the same part of the crop as in the paper.

    Source: MoCo-Flow Table 1. Where it does not say the direction: the mean over right, left, down
    and up, and over both senses of turning about the middle of the person's box.
    """
    reading = protocol(configuration, side, misplaced_notes(side, configuration))
    rows = []
    for misplacement in MISPLACEMENTS:
        found = [
            _scores(on_white(rgb, mask), mask, move, side)
            for rgb, mask in views
            for move in moves(misplacement, mask, side / configuration.crop_reference_px)
        ]
        moved_px = misplacement.moved_px(side / configuration.crop_reference_px)
        rows += [
            MisalignmentRow(
                *(scene, misplacement.kind, misplacement.amount, misplacement.unit, moved_px),
                metric,
                float(np.mean([scores[metric] for scores in found])),
                len(views),
                reading,
            )
            for metric in (found[0] if found else {})
        ]
    return rows


def misplaced_notes(side: int, configuration: EvaluationConfig) -> list[str]:
    """What the protocol of a misplaced view says besides the scores' own."""
    return [
        f"n px are n x {side}/{configuration.crop_reference_px} px of this picture",
        "mean over four directions, or both senses of turning about the middle of the box",
    ]


def write_misalignment(rows: Iterable[MisalignmentRow], path: Path) -> None:
    """Write the rows as a Parquet table."""
    records = [row._asdict() for row in rows]
    parquet.write_table(pa.Table.from_pylist(records, schema=SCHEMA), path)


def read_misalignment(path: Path) -> list[MisalignmentRow]:
    """The rows of a table written by ``write_misalignment``."""
    return [MisalignmentRow(**record) for record in parquet.read_table(path).to_pylist()]


def moves(misplacement: Misplacement, mask: Mask, scale: float) -> Iterator[NDArray[np.float64]]:
    """Each direction of a misplacement as a matrix (2, 3) from pixels to pixels.

    ``scale``: pixels of this picture for one of the paper's crop.
    """
    kind, amount = misplacement
    if kind == "shifted":
        for x, y in _DIRECTIONS:
            yield np.array([[1.0, 0.0, scale * amount * x], [0.0, 1.0, scale * amount * y]])
        return
    top, left, bottom, right = bounding_box(mask)
    middle = (0.5 * (left + right - 1), 0.5 * (top + bottom - 1))
    for degrees in (amount, -amount):
        yield np.asarray(cv2.getRotationMatrix2D(middle, degrees, 1.0), np.float64)


def moved_picture(picture: Image, move: NDArray[np.float64]) -> Image:
    """A picture (H, W, 3) on white, moved by a matrix (2, 3)."""
    size, white = (picture.shape[1], picture.shape[0]), (WHITE,) * 3
    moved = cv2.warpAffine(picture, move, size, flags=cv2.INTER_LINEAR, borderValue=white)
    return np.asarray(moved, np.float32)


def _scores(truth: Image, mask: Mask, move: NDArray[np.float64], side: int) -> dict[str, float]:
    size = (mask.shape[1], mask.shape[0])
    moved = moved_picture(truth, move)
    covered = cv2.warpAffine(mask.astype(np.float32), move, size, flags=cv2.INTER_LINEAR) > 0.5
    crop = crop_around(mask, side)
    ours, theirs = crop.of(moved, WHITE), crop.of(truth, WHITE)
    return {
        "psnr": psnr(ours, theirs),
        "ssim": ssim(ours, theirs),
        "psnr_union": psnr(moved, truth, covered | mask),
    }
