"""Every held-out view beside its photograph, their difference, and the baseline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mocoflow_core.capture.clip import Clip
from mocoflow_core.metrics.score import on_white
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.report.inputs import BASELINE, ReportInputs
from mocoflow_core.report.metric_labels import VIEW_METRICS
from mocoflow_core.report.pictures import (
    Picture,
    cut_to_person,
    data_uri,
    difference_picture,
    read_picture,
    webps_within,
)

BUDGET_BYTES = 5_000_000
CAPTION_METRICS = ("psnr_union", "ssim", "mask_iou")

# (method, camera, frame) -> metric -> value
Scores = Mapping[tuple[str, str, int], Mapping[str, float]]


class FrameView(NamedTuple):
    """One moment seen by one held-out camera."""

    frame_index: int
    pictures: list[str]  # data URIs in the order of the camera's columns
    captions: list[str]  # one line below each picture


@dataclass(frozen=True)
class CameraViews:
    """All scored moments of one camera."""

    camera: str
    columns: list[str]
    frames: list[FrameView]
    opens_at: int  # position of the view with the median score, neither the best nor the worst


class _Sheet(NamedTuple):
    camera: str
    columns: list[str]
    frame_indices: list[int]
    rows: list[list[Picture]]


def held_out_views(inputs: ReportInputs, rows: Sequence[ScoreRow]) -> list[CameraViews]:
    """What each held-out camera saw and what was rendered for it; empty without renders."""
    scores: dict[tuple[str, str, int], dict[str, float]] = {}
    for row in rows:
        scores.setdefault((row.method, row.camera, row.frame_index), {})[row.metric] = row.value
    sheets = [sheet for clip in _clips(inputs) if (sheet := _sheet(inputs, clip)).rows]
    pictures = [picture for sheet in sheets for row in sheet.rows for picture in row]
    uris = iter([data_uri(f, "image/webp") for f in webps_within(pictures, BUDGET_BYTES)])
    return [_camera(inputs.method, sheet, uris, scores) for sheet in sheets]


def _clips(inputs: ReportInputs) -> Iterator[Clip]:
    """The other cameras first, then the train camera, of which held-out frames alone count."""
    if inputs.evaluation is not None:
        for folder in sorted(path for path in inputs.evaluation.iterdir() if path.is_dir()):
            yield Clip.load(folder)
    if inputs.seen is not None:
        yield inputs.seen


def _sheet(inputs: ReportInputs, clip: Clip) -> _Sheet:
    """The pictures of one camera, cut to windows around the person."""
    name = clip.camera.name
    usable = clip.has_mask & (clip.held_out | (name != inputs.train_camera))
    usable &= np.asarray([_file(inputs.views, name, i) is not None for i in clip.frame_indices])
    chosen = np.flatnonzero(usable)
    compared = bool(len(chosen)) and all(
        _file(inputs.baseline_views, name, i) for i in clip.frame_indices[chosen]
    )
    columns = ["photograph", inputs.method, "difference", *([BASELINE] if compared else [])]
    rows = []
    for row in chosen:
        index = clip.frame_indices[row]
        truth = np.round(255.0 * on_white(clip.frames[row], clip.masks[row])).astype(np.uint8)
        rendered = read_picture(_file(inputs.views, name, index))  # type: ignore[arg-type]
        pictures = [truth, rendered, difference_picture(rendered, truth)]
        if compared:
            pictures.append(read_picture(_file(inputs.baseline_views, name, index)))  # type: ignore[arg-type]
        rows.append(pictures)
    rows = cut_to_person(rows)
    return _Sheet(name, columns, [int(i) for i in clip.frame_indices[chosen]], rows)


def _file(folder: Path | None, camera: str, frame_index: int) -> Path | None:
    path = None if folder is None else folder / camera / f"{frame_index:06d}.png"
    return path if path is not None and path.is_file() else None


def _camera(method: str, sheet: _Sheet, uris: Iterator[str], scores: Scores) -> CameraViews:
    frames = []
    for index, pictures in zip(sheet.frame_indices, sheet.rows, strict=True):
        captions = [
            _caption(scores.get((column, sheet.camera, index), {})) for column in sheet.columns
        ]
        frames.append(FrameView(index, [next(uris) for _ in pictures], captions))
    values = [
        scores.get((method, sheet.camera, index), {}).get("psnr_union", 0.0)
        for index in sheet.frame_indices
    ]
    median = int(np.argsort(values, kind="stable")[len(values) // 2])
    return CameraViews(sheet.camera, sheet.columns, frames, median)


def _caption(scores: Mapping[str, float]) -> str:
    return " · ".join(
        f"{VIEW_METRICS[metric].title} {VIEW_METRICS[metric].with_unit(scores[metric])}"
        for metric in CAPTION_METRICS
        if metric in scores
    )
