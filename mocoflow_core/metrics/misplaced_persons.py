"""What detectors and a perceptual network say of misplaced photographs: Table 1, its other rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.io.pictures import as_bytes
from mocoflow_core.metrics.crop import crop_around
from mocoflow_core.metrics.misalignment import (
    MISPLACEMENTS,
    Mask,
    MisalignmentRow,
    Misplacement,
    misplaced_notes,
    moved_picture,
    moves,
)
from mocoflow_core.metrics.perceptual import LpipsAlex, lpips_protocol
from mocoflow_core.metrics.person_judge import Networks
from mocoflow_core.metrics.score import WHITE, EvaluationConfig, on_white
from mocoflow_core.perception.person import Picture
from mocoflow_core.progress import Progress, untold

View = tuple[NDArray[np.uint8], Mask]


def misplaced_person_rows(
    scene: str,
    views: Sequence[View],
    side: int,
    configuration: EvaluationConfig,
    networks: Networks,
    progress: Progress = untold,
) -> list[MisalignmentRow]:
    """``lpips_alex``, ``plausibility`` and ``oks`` of views against themselves, misplaced.

    A shifted person is the same person to a detector: plausibility and OKS should not move where
    PSNR and LPIPS do. A view whose photograph has no pose has no OKS, and is not among its views.

    Args:
        views: photographs (H, W, 3) with the person's mask (H, W), which has true pixels.
        side: of the crop in pixels, as for the scores.

    Source: MoCo-Flow Table 1.
    """
    judge, lpips = networks
    notes = [f"crop {side} px on white", *misplaced_notes(side, configuration)]
    readings = {
        "lpips_alex": lpips_protocol(lpips),
        "plausibility": judge.plausibility_protocol(),
        "oks": judge.oks_protocol(),
    }
    scale = side / configuration.crop_reference_px
    rows = []
    for number, misplacement in enumerate(MISPLACEMENTS):
        by = f"{misplacement.amount:g} {misplacement.unit}"
        progress(number / len(MISPLACEMENTS), f"views {misplacement.kind} by {by}")
        found = [_scores(view, misplacement, scale, side, networks) for view in views]
        for metric, reading in readings.items():
            counted = [scores[metric] for scores in found if scores[metric]]
            said = f"{len(views) - len(counted)} of {len(views)} views left out"
            if counted:
                rows.append(
                    MisalignmentRow(
                        *(scene, misplacement.kind, misplacement.amount, misplacement.unit),
                        misplacement.moved_px(scale),
                        *(metric, float(np.mean(counted)), len(counted)),
                        "; ".join(
                            [*notes, reading, *([said] if len(counted) < len(views) else [])]
                        ),
                    )
                )
    return rows


def _scores(
    view: View, misplacement: Misplacement, scale: float, side: int, networks: Networks
) -> dict[str, list[float]]:
    """The scores of every direction of a misplacement."""
    rgb, mask = view
    truth, crop = on_white(rgb, mask), crop_around(mask, side)
    judge, lpips = networks
    pictures = [
        as_bytes(crop.of(picture, WHITE))
        for picture in (truth, *(moved_picture(truth, m) for m in moves(misplacement, mask, scale)))
    ]
    reference, *sights = judge.look(pictures)
    theirs, *ours = (_features(picture, lpips) for picture in pictures)
    area_px = float(mask.sum())
    known = sights if judge.has_reference(reference) else []
    return {
        "lpips_alex": [lpips.distance(one, theirs) for one in ours],
        "plausibility": [float(sight.person) for sight in sights],
        "oks": [judge.similarity(sight, reference, area_px) for sight in known],
    }


def _features(picture: Picture, lpips: LpipsAlex) -> list[Tensor]:
    return lpips.features(picture / np.float32(255.0))
