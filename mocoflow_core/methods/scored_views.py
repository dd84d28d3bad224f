"""Rendered views against their photographs, as rows of the table of scores."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from mocoflow_core.methods.rendered_views import Image, Renderer, ScoredView
from mocoflow_core.metrics.crop import crop_around, crop_side
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.score import EvaluationConfig, protocol, score_view
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.views import draw_views
from mocoflow_core.progress import Progress


class Subject(NamedTuple):
    """Whose scores these are."""

    scene: str
    seed: int


class NetworkMeans(Protocol):
    """Scores of renders by networks."""

    def means(self, renders: Sequence[Image]) -> dict[str, float]:
        """Means by metric over renders (H, W, 3), one of each view."""


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
        render = renderer.render(view.camera, view.frame_index)
        scores = _score(view, render, side, configuration)
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
    networks: NetworkMeans | None = None,
) -> list[CurveRow]:
    """Mean scores over a small seeded draw of the views, at each kept moment.

    ``networks`` adds its own means of the same renders: those of ``few_views``.
    """
    if not views:
        return []
    side = side_of(views, configuration)
    drawn = few_views(views, configuration)
    rows = []
    for number, moment in enumerate(moments):
        renders = [moment.renderer.render(view.camera, view.frame_index) for view in drawn]
        scores = [
            _score(view, render, side, configuration)
            for view, render in zip(drawn, renders, strict=True)
        ]
        means = {name: float(np.mean([score[name] for score in scores])) for name in scores[0]}
        if networks is not None:
            means |= networks.means([rgb for rgb, _ in renders])
        for metric, value in means.items():
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
    view: ScoredView, render: tuple[Image, Image], side: int, configuration: EvaluationConfig
) -> dict[str, float]:
    rgb, opacity = render
    mask = np.asarray(view.clip.masks[view.row])
    photograph = np.asarray(view.clip.frames[view.row])
    return score_view(rgb, opacity, photograph, mask, crop_around(mask, side), configuration)
