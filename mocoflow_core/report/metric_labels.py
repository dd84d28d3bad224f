"""How each metric is written for people: title, unit, digits and which way is better."""

from __future__ import annotations

import math
from typing import NamedTuple


class MetricLabel(NamedTuple):
    """The words around a number."""

    title: str
    unit: str
    digits: int
    higher_is_better: bool

    def text(self, value: float) -> str:
        """The value with its digits, without its unit; a dash where there is none."""
        if math.isnan(value):
            return "–"
        return f"{value:.{self.digits}f}" if math.isfinite(value) else "∞"

    def with_title(self) -> str:
        """The title with the unit that the numbers have."""
        return f"{self.title}, {self.unit}" if self.unit else self.title

    def with_unit(self, value: float) -> str:
        """The value with its digits and unit."""
        return f"{self.text(value)} {self.unit}".rstrip()


# Scores of single views against a photograph.
VIEW_METRICS = {
    "psnr_union": MetricLabel("PSNR, person", "dB", 2, True),
    "ssim": MetricLabel("SSIM", "", 3, True),
    "lpips_alex": MetricLabel("LPIPS", "", 3, False),
    "plausibility": MetricLabel("plausibility", "", 2, True),
    "oks": MetricLabel("OKS", "", 3, True),
    "mask_iou": MetricLabel("mask overlap", "", 3, True),
    "psnr": MetricLabel("PSNR, crop", "dB", 2, True),
    "psnr_image": MetricLabel("PSNR, image", "dB", 2, True),
    "orbit_residual_mm": MetricLabel("keypoints around", "mm", 1, False),
    "train_psnr": MetricLabel("PSNR, train camera", "dB", 2, True),
}

# Errors of the motion and the shape: what the optimisation repaired.
BODY_METRICS = {
    "keypoint_mm": MetricLabel("keypoints", "mm", 1, False),
    "keypoint_lateral_mm": MetricLabel("keypoints, across the line of sight", "mm", 1, False),
    "keypoint_depth_mm": MetricLabel("keypoints, along the line of sight", "mm", 1, False),
    "correspondence_mm": MetricLabel("correspondence between frames", "mm", 1, False),
    "surface_mm": MetricLabel("surface", "mm", 1, False),
    "consensus_local_mm": MetricLabel("consensus, local", "mm", 2, False),
    "consensus_global_mm": MetricLabel("consensus, global", "mm", 2, False),
}


# What a run costs, on its training clock.
COSTS = {
    "cpu_s": MetricLabel("training, CPU", "s", 1, False),
    "wall_s": MetricLabel("training, wall", "s", 1, False),
}


def label_of(metric: str) -> MetricLabel:
    """The label of a metric; one that has none here is shown by its own name."""
    known = VIEW_METRICS | BODY_METRICS | COSTS
    return known.get(metric, MetricLabel(metric, "mm" if metric.endswith("_mm") else "", 3, True))
