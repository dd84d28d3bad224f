"""The key numbers of several seeds: their mean, between the lowest and the highest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mocoflow_core.metrics.benchmark_tables import Contender, Runs
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.report.score_tables import key_numbers

METRICS = (
    *("psnr_union", "psnr", "ssim", "lpips_alex", "mask_iou", "plausibility", "oks"),
    *("keypoint_mm", "surface_mm", "correspondence_mm"),
)


class SeedSummary(NamedTuple):
    """One metric of one contender."""

    mean: float
    low: float
    high: float
    seeds: int


Summaries = dict[Contender, dict[str, SeedSummary]]


def summarise(runs: Runs[ScoreRow], train_cameras: Mapping[str, str]) -> Summaries:
    """Mean and range over seeds of each run's key numbers.

    Args:
        train_cameras: name of the train camera by scene.
    """
    found: Summaries = {}
    for contender, seeds in runs.items():
        camera = train_cameras[contender.scene]
        numbers = [key_numbers(rows, contender.method, camera) for rows in seeds.values()]
        found[contender] = {
            metric: SeedSummary(float(np.mean(known)), min(known), max(known), len(known))
            for metric in METRICS
            if (known := [number[metric] for number in numbers if metric in number])
        }
    return found
