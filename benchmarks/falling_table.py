"""How far each curve of error against time ends below its own best, as a table."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

from mocoflow_core.metrics.benchmark_tables import Runs
from mocoflow_core.metrics.curve import CurveRow

METRIC = "psnr_union"


class Fall(NamedTuple):
    """One run: PSNR over the person (dB) and CPU seconds of the training clock."""

    best: float
    best_s: float
    last: float
    last_s: float

    @property
    def lost(self) -> float:
        """What was gained and lost again, dB; 0 where the error fell to the end."""
        return self.best - self.last


def fall_of(rows: Sequence[CurveRow]) -> Fall:
    """The best and the last value of one run's curve."""
    curve = sorted((row for row in rows if row.metric == METRIC), key=lambda row: row.step)
    best = max(curve, key=lambda row: row.value)
    return Fall(best.value, best.cpu_s, curve[-1].value, curve[-1].cpu_s)


def falling_table(runs: Runs[CurveRow]) -> str:
    """Markdown: a line for each scene and setting; medians over seeds, least and most."""
    lines = [
        "| scene | setting | seeds | best, dB | at, s | last, dB | at, s | lost again, dB |",
        "|-|-|-:|-:|-:|-:|-:|-:|",
    ]
    for contender, seeds in runs.items():
        falls = [fall_of(rows) for rows in seeds.values()]
        lines.append(
            f"| {contender.scene} | {contender.method} | {len(falls)} "
            f"| {_spread([f.best for f in falls])} | {median(f.best_s for f in falls):.1f} "
            f"| {_spread([f.last for f in falls])} | {median(f.last_s for f in falls):.1f} "
            f"| {_spread([f.lost for f in falls])} |"
        )
    return "\n".join(lines) + "\n"


def _spread(values: Sequence[float]) -> str:
    """The median, with the least and the most where they differ."""
    low, middle, high = (f"{v:.2f}" for v in (min(values), median(values), max(values)))
    return middle if low == high else f"{middle} ({low} to {high})"
