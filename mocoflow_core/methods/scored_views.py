"""Rendered views against their photographs, as rows of the table of scores."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mocoflow_core.methods.rendered_views import Progress, Renderer, ScoredView
from mocoflow_core.metrics.crop import crop_around, crop_side
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.score import EvaluationConfig, protocol, score_view
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.views import draw_views


class Subject(NamedTuple):
    """Whose scores these are."""

    scene: str
    seed: int


class Moment(NamedTuple):
    """A state that was kept, and its training clock."""

    method: str
    stage: str
    step: int
    wall_s: float
    cpu_s: float
    renderer: Renderer


def score_views(
    subject: Subject,
    method: str,
    views: Sequence[ScoredView],
    renderer: Renderer,
    configuration: EvaluationConfig,
) -> list[ScoreRow]:
    """Scores of one method's views; the crop is the same for all methods."""
    side = side_of(views, configuration)
    rows = []
    for view in views:
        scores = _score(view, renderer, side, configuration)
        rows += [
            ScoreRow(
                subject.scene,
                method,
                subject.seed,
                view.camera.name,
                view.frame_index,
                metric,
                value,
                protocol(configuration, side),
            )
            for metric, value in scores.items()
        ]
    return rows


def error_curve(
    subject: Subject,
    moments: Sequence[Moment],
    views: Sequence[ScoredView],
    configuration: EvaluationConfig,
    progress: Progress,
) -> list[CurveRow]:
    """Mean scores over a small seeded draw of the views, at each kept moment."""
    if not views:
        return []
    side = side_of(views, configuration)
    drawn = few_views(views, configuration)
    rows = []
    for number, moment in enumerate(moments):
        scores = [_score(view, moment.renderer, side, configuration) for view in drawn]
        for metric in scores[0]:
            value = float(np.mean([score[metric] for score in scores]))
            rows.append(
                CurveRow(
                    subject.scene,
                    moment.method,
                    subject.seed,
                    moment.stage,
                    moment.step,
                    moment.wall_s,
                    moment.cpu_s,
                    metric,
                    value,
                )
            )
        progress((number + 1) / len(moments), f"error at step {moment.step}")
    return rows


def few_views(views: Sequence[ScoredView], configuration: EvaluationConfig) -> list[ScoredView]:
    """The small seeded draw that is affordable again and again."""
    named = {(view.camera.name, view.frame_index): view for view in views}
    drawn = draw_views(list(named), configuration.curve_views, configuration.seed)
    return [named[name] for name in drawn]


def side_of(views: Sequence[ScoredView], configuration: EvaluationConfig) -> int:
    """Side of the crop that all scored views of a scene share."""
    masks = (view.clip.masks[view.row] for view in views)
    return crop_side(masks, configuration.crop_share, configuration.crop_box_margin)


def _score(
    view: ScoredView, renderer: Renderer, side: int, configuration: EvaluationConfig
) -> dict[str, float]:
    rgb, opacity = renderer.render(view.camera, view.frame_index)
    mask = np.asarray(view.clip.masks[view.row])
    photograph = np.asarray(view.clip.frames[view.row])
    return score_view(rgb, opacity, photograph, mask, crop_around(mask, side), configuration)
