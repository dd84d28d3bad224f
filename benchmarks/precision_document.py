"""The work-precision study as Markdown: what was run, where, and its tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from statistics import median

from benchmarks.knobs import DEFAULT
from benchmarks.precision_chart import BUDGET, JOINT, sweep_seeds
from benchmarks.precision_front import (
    BETTER_DB,
    LESS_TIME,
    beats_default,
    default_of,
    gain_db,
    verdict,
)
from benchmarks.precision_rows import Point, Row, points_of
from mocoflow_core.io.machine import describe_machine


def write_document(rows: Sequence[Row], command: str, path: Path) -> None:
    """Write all tables; numbers are medians over seeds."""
    everything, swept = points_of(rows), points_of(rows, sweep_seeds(rows))
    sections = (
        _heading(rows, command),
        _defaults(everything),
        _sweep(swept),
        _joint(rows),
        _budgets(swept),
    )
    path.write_text("\n\n".join("\n".join(lines) for lines in sections if lines) + "\n")


def _heading(rows: Sequence[Row], command: str) -> list[str]:
    machine = describe_machine()
    spent_s = sum(row.optimisation_s for row in rows)
    return [
        "# Work against precision",
        "",
        f"{date.today():%d %B %Y}; {machine['model']}, {machine['cores']} cores shared with other "
        "work, one torch thread.",
        f"`{command}`: {len(rows)} runs on {', '.join(f'`{s}`' for s in _scenes(rows))}; "
        f"{spent_s / 60:.0f} minutes of optimisation.",
        "",
        "CPU seconds of the training clock; PSNR over the person and mask overlap (IoU) at eight "
        "views of other cameras,",
        "medians over the seeds. Every run is a row of [work_precision.csv](work_precision.csv).",
        "",
        "![CPU seconds against error, a line for each knob](work_precision.png)",
    ]


def _defaults(points: Sequence[Point]) -> list[str]:
    lines = [
        "## The defaults",
        "",
        "| scene | seeds | preparation, s | optimisation, s | PSNR, dB | IoU |",
        "|-|-:|-:|-:|-:|-:|",
    ]
    for scene in _scenes(points):
        p = default_of(points, scene)
        lines.append(
            f"| {scene} | {p.seeds} | {p.preparation_s:.1f} | {p.optimisation_s:.1f} "
            f"| {p.psnr_union:.2f}{_range(p)} | {p.mask_iou:.3f} |"
        )
    return lines


def _sweep(points: Sequence[Point]) -> list[str]:
    scenes = _scenes(points)
    lines = [
        "## One knob at a time",
        "",
        "Against the defaults: CPU seconds in all, PSNR and IoU; in brackets the gain, which is "
        "the PSNR above what a longer",
        "or shorter schedule of the defaults reaches in the same seconds.",
        "",
        f"| knob | value | {' | '.join(scenes)} | beats the default |",
        f"|-|-|{'-|' * len(scenes)}-|",
    ]
    for knob, value in _settings(points):
        if knob not in (DEFAULT.knob, BUDGET, JOINT):
            settings = _on_every_scene(points, knob, value)
            cells = " | ".join(_against_default(p, points) for p in settings)
            lines.append(f"| {knob} | {value} | {cells} | {_beats(settings, points)} |")
    return lines


def _joint(rows: Sequence[Row]) -> list[str]:
    """The best settings together, with all seeds that they share with the defaults."""
    points = points_of(rows)
    candidates = [
        (knob, value)
        for knob, value in _settings(points)
        if knob not in (DEFAULT.knob, BUDGET)
        and _on_every_scene(points, knob, value)[0].seeds > len(sweep_seeds(rows))
    ]
    if not candidates:
        return ["## Around the best", "", "No knob gains over a longer or shorter schedule."]
    scenes = _scenes(points)
    seeds = _on_every_scene(points, *candidates[0])[0].seeds
    lines = [
        "## Around the best",
        "",
        f"The settings with the largest gains together; {seeds} seeds.",
        "",
        f"| setting | {' | '.join(scenes)} | beats the default |",
        f"|-|{'-|' * len(scenes)}-|",
    ]
    for knob, value in candidates:
        settings = _on_every_scene(points, knob, value)
        cells = " | ".join(_against_default(p, points) for p in settings)
        name = value if knob == JOINT else f"{knob} {value}"
        lines.append(f"| {name} | {cells} | {_beats(settings, points)} |")
    lines += [
        "",
        f"A setting beats the default that is at least {BETTER_DB} dB better at the same time, or "
        f"takes {LESS_TIME:.0%} less",
        "time at the same error, on every scene.",
    ]
    return lines


def _budgets(points: Sequence[Point]) -> list[str]:
    lines = [
        "## What a budget buys",
        "",
        "`schedule.budget_s`, which `--budget` sets: seconds of the training clock, preparation "
        "included; here CPU seconds, as on",
        "one idle core. Medians over the scenes, with the least and the most. No steps: the "
        "preparation took longer. Where the",
        "default schedule is done earlier, the rest is given back.",
        "",
        "| budget | used, s | steps | rays | PSNR, dB | IoU |",
        "|-:|-:|-:|-:|-:|-:|",
    ]
    for knob, value in _settings(points):
        if knob == BUDGET:
            runs = _on_every_scene(points, knob, value)
            lines.append(
                f"| {value} | {_spread([p.cpu_s for p in runs], '.1f')} "
                f"| {_spread([p.steps for p in runs], '.0f')} "
                f"| {_spread([p.rays for p in runs], '.0f')} "
                f"| {_spread([p.psnr_union for p in runs], '.1f')} "
                f"| {_spread([p.mask_iou for p in runs], '.3f')} |"
            )
    return lines


def _against_default(point: Point, points: Sequence[Point]) -> str:
    default = default_of(points, point.scene)
    return (
        f"{point.cpu_s / default.cpu_s - 1:+.0%}, {point.psnr_union - default.psnr_union:+.2f} dB, "
        f"{point.mask_iou - default.mask_iou:+.3f} ({gain_db(point, points):+.2f})"
    )


def _beats(settings: Sequence[Point], points: Sequence[Point]) -> str:
    if beats_default(settings, points):
        return "yes"
    found = [p for p in settings if verdict(p, default_of(points, p.scene))]
    return f"on {len(found)} of {len(settings)}" if found else "no"


def _range(point: Point) -> str:
    if point.seeds == 1:
        return ""
    return f" ({point.lowest_psnr:.2f} to {point.highest_psnr:.2f})"


def _spread(values: Sequence[float], form: str) -> str:
    low, middle, high = (f"{v:{form}}" for v in (min(values), median(values), max(values)))
    return middle if low == high else f"{middle} ({low} to {high})"


def _scenes(found: Iterable[Row | Point]) -> list[str]:
    return list(dict.fromkeys(row.scene for row in found))


def _settings(points: Iterable[Point]) -> list[tuple[str, str]]:
    return list(dict.fromkeys((p.knob, p.value) for p in points))


def _on_every_scene(points: Iterable[Point], knob: str, value: str) -> list[Point]:
    return [p for p in points if (p.knob, p.value) == (knob, value)]
