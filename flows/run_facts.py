"""What a run says about itself: for run.json, for the report and for Prefect's pages."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from prefect.artifacts import create_markdown_artifact, create_table_artifact

from mocoflow_core.artifacts import (
    Artifact,
    ClipArtifact,
    EvaluationArtifact,
    SceneArtifact,
    ScoresArtifact,
)
from mocoflow_core.io.run_folder import RunRecord, StageRecord
from mocoflow_core.methods.benchmark_folder import BenchmarkRecord
from mocoflow_core.report.markdown_text import code, file_link, plain, unlinked_rows

# What rendering the run again needs to know of its clip.
CAPTURE = ("fps", "source_fps", "first_frame", "last_frame", "up")


def describe_run(
    clip: ClipArtifact,
    evaluation: EvaluationArtifact,
    trained: SceneArtifact,
    scores: ScoresArtifact,
    stages: Sequence[Artifact],
    elapsed_s: float,
) -> dict[str, Any]:
    """The fields of ``run.json`` that are known once all is scored."""
    worked_s = sum(stage.wall_s for stage in records(stages) if not stage.cached)
    camera = {**clip.summary["camera"]}
    train_camera = camera.pop("name")
    return {
        "machine": {
            **trained.summary["machine"],
            "threads": trained.summary["threads"],
            "devices": trained.summary.get("devices", 1),
        },
        "train_camera": train_camera,
        "capture": {name: clip.summary[name] for name in CAPTURE},
        "cameras": {train_camera: camera, **evaluation.summary["cameras"]},
        "overhead_s": max(elapsed_s - worked_s, 0.0),
        "stages": records(stages),
        "scores": scores.summary["mean"],
        "warnings": tuple(dict.fromkeys(w for stage in stages for w in stage.warnings)),
        "guard_events": tuple(str(event) for event in trained.summary["events"]),
    }


def records(stages: Iterable[Artifact]) -> tuple[StageRecord, ...]:
    """Each stage once, with its cost and whether it was found in the store."""
    once = {stage.key: stage for stage in stages}
    return tuple(
        StageRecord(
            name=stage.stage,
            key=stage.key,
            wall_s=stage.wall_s,
            cpu_s=stage.cpu_s,
            cached=stage.cached,
        )
        for stage in once.values()
    )


def show_in_prefect(record: RunRecord, report: Path, picture: Path) -> None:
    """On the run's page: the scores, the error curve, the stages and a link to the report."""
    rows = [
        {"method": method, "camera": camera, **metrics}
        for method, cameras in record.scores.items()
        for camera, metrics in cameras.items()
    ]
    scene = plain(record.scene)
    create_table_artifact(unlinked_rows(rows), key="scores", description=f"Mean scores of {scene}")
    curve = "\n".join([f"# {scene}", "", *_embedded(picture)])
    create_markdown_artifact(curve, key="error-curve", description="Error against run time")
    lines = [f"# {scene}", "", f"{file_link('Report', report)}: {code(str(report))}", ""]
    lines += ["| stage | seconds | CPU seconds | |", "|-|-|-|-|"]
    lines += [
        f"| {s.name} | {s.wall_s:.1f} | {s.cpu_s:.1f} | {'from the store' if s.cached else ''} |"
        for s in record.stages
    ]
    create_markdown_artifact(
        "\n".join(lines), key="report", description=f"Run on {plain(record.scene)}"
    )


def show_benchmark_in_prefect(record: BenchmarkRecord, page: Path, chart: Path) -> None:
    """On the benchmark's page: the scores, the chart, what is missing and where the page lies."""
    asked = code(record.command)
    rows = unlinked_rows(record.summary)
    create_table_artifact(rows, key="benchmark-scores", description=asked)
    lines = ["# Error against run time", "", code(str(page)), "", *_embedded(chart)]
    lines += [asked, *_listed("worse than usual", record.regressions)]
    lines += _listed("omission", record.omissions)
    create_markdown_artifact("\n".join(lines), key="benchmark", description=asked)


def _listed(title: str, found: Sequence[Mapping[str, Any]]) -> list[str]:
    """A table of what and why; nothing where there is nothing."""
    rows = [f"| {plain(str(row['what']))} | {plain(str(row['why']))} |" for row in found]
    return ["", f"| {title} | |", "|-|-|", *rows] if rows else []


def _embedded(picture: Path) -> list[str]:
    """Markdown lines that hold the picture itself; none where there is none."""
    if not picture.exists():
        return []
    content = base64.b64encode(picture.read_bytes()).decode()
    return [f"![error against time](data:image/png;base64,{content})", ""]
