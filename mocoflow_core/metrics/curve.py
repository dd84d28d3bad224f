"""Error against run time: one row per metric and checkpoint on the training clock."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
from pyarrow import parquet

SCHEMA = pa.schema(
    [
        ("scene", pa.string()),
        ("method", pa.string()),
        ("seed", pa.int64()),
        ("stage", pa.string()),
        ("step", pa.int64()),
        ("wall_s", pa.float64()),
        ("cpu_s", pa.float64()),
        ("metric", pa.string()),
        ("value", pa.float64()),
    ]
)

# What the training clock counts, in the order of a run. Evaluation, rendering and the report do
# not make the scene any better, and orchestration is reported beside it.
CLOCKED_STAGES = (
    "extract_clip",
    "ingest_meshes",
    "locate_body",
    "repair_body",
    "inspect_scene",
    "plan_scene",
    "pretrain_density",
    "fit_motion",
    "optimise_scene",
)

# What networks say, measured along the curve where ``person_scores.on_curve`` is set.
NETWORK_METRICS = ("lpips_alex", "plausibility", "oks")

# What is measured along the curve; distances to the truth are taken at the end alone.
CURVE_METRICS = (
    *("psnr_union", "psnr", "psnr_image", "ssim", "mask_iou", "train_psnr"),
    *NETWORK_METRICS,
)

# Errors that are 1 - score; the others are errors already, or PSNR.
SIMILARITIES = ("ssim", "mask_iou", "plausibility", "oks")


class CurveRow(NamedTuple):
    """One number of ``error_curve.parquet``; seconds since the start of the training clock."""

    scene: str
    method: str
    seed: int
    stage: str
    step: int
    wall_s: float
    cpu_s: float
    metric: str
    value: float


class StageSpan(NamedTuple):
    """When a stage ran on the training clock."""

    name: str
    start_s: float
    end_s: float


def write_curve(rows: Sequence[CurveRow], path: Path) -> None:
    """Write the rows as a Parquet table, in their order."""
    records = [row._asdict() for row in rows]
    parquet.write_table(pa.Table.from_pylist(records, schema=SCHEMA), path)


def read_curve(path: Path) -> list[CurveRow]:
    """The rows of a table written by ``write_curve``; a benchmark's further column is left out."""
    records = parquet.read_table(path, columns=SCHEMA.names).to_pylist()
    return [CurveRow(**record) for record in records]


def as_error(metric: str, value: float) -> float:
    """A score as an error that falls towards 0: MSE for PSNR, 1 - score for similarities."""
    if "psnr" in metric:
        return float(10.0 ** (-value / 10.0))
    return 1.0 - value if metric in SIMILARITIES else value


def seconds_to_target(
    rows: Iterable[CurveRow], metric: str, target: float, clock: str = "wall_s"
) -> float | None:
    """First second at which one run's ``metric`` is at least as good as ``target``.

    None when it was never reached. ``clock`` is ``wall_s`` or ``cpu_s``.
    """
    bound = as_error(metric, target)
    reached = [
        float(getattr(row, clock))
        for row in rows
        if row.metric == metric and as_error(metric, row.value) <= bound
    ]
    return min(reached, default=None)


def training_spans(
    stages: Iterable[Mapping[str, object]], clock: str = "wall_s"
) -> list[StageSpan]:
    """Stages of ``run.json`` laid end to end on the training clock.

    A cached stage counts with the seconds that it took when it was computed.

    Args:
        stages: mappings with ``name`` and seconds under ``clock`` (``wall_s`` or ``cpu_s``).
    """
    seconds = {str(stage["name"]): float(stage[clock]) for stage in stages}  # type: ignore[arg-type]
    spans, start = [], 0.0
    for name in CLOCKED_STAGES:
        if name in seconds:
            spans.append(StageSpan(name, start, start + seconds[name]))
            start += seconds[name]
    return spans
