"""What detectors and a perceptual network say of renders, as rows of the table of scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from mocoflow_core.io.pictures import as_bytes
from mocoflow_core.methods.rendered_views import Renderer, ScoredView
from mocoflow_core.methods.scored_views import Subject, side_of
from mocoflow_core.metrics.crop import Crop, crop_around
from mocoflow_core.metrics.perceptual import LpipsAlex, lpips_protocol
from mocoflow_core.metrics.person_judge import Networks, PersonJudge, PersonScoreConfig, Sight
from mocoflow_core.metrics.score import WHITE, EvaluationConfig, on_white
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.views import draw_views
from mocoflow_core.perception.person import Picture

# Rows of these methods are of the photographs: as they are, which no render can exceed, and moved
# by half a pixel, which is how far the detectors agree with themselves.
PHOTOGRAPH, SHIFTED_PHOTOGRAPH = "photograph", "shifted_photograph"
PHOTOGRAPHS = (PHOTOGRAPH, SHIFTED_PHOTOGRAPH)
LPIPS, PLAUSIBILITY, OKS = "lpips_alex", "plausibility", "oks"


class Cut(NamedTuple):
    """A scored view's photograph on white, cut to the crop."""

    view: ScoredView
    crop: Crop
    picture: Picture
    area_px: float  # of the truth mask

    def render(self, renderer: Renderer) -> Picture:
        """What a method shows in place of the photograph."""
        rgb, _ = renderer.render(self.view.camera, self.view.frame_index)
        return self.of(rgb)

    def of(self, rgb: NDArray[np.floating]) -> Picture:
        """The same cut of a render (H, W, 3) over white."""
        return as_bytes(self.crop.of(rgb, WHITE))


def network_rows(
    subject: Subject,
    renderers: Mapping[str, Renderer],
    views: Sequence[ScoredView],
    evaluating: EvaluationConfig,
    configuration: PersonScoreConfig,
    networks: Networks,
) -> list[ScoreRow]:
    """Rows of ``lpips_alex``, ``plausibility`` and ``oks``."""
    judge, lpips = networks
    if not views:
        return []
    side = side_of(views, evaluating)
    cuts = [cut_of(view, side) for view in views]
    rows = lpips_rows(subject, renderers, cuts, lpips, side)
    drawn = _drawn(cuts, configuration.views, evaluating.seed)
    return rows + person_rows(subject, renderers, drawn, judge, len(views))


def cut_of(view: ScoredView, side: int) -> Cut:
    """The view's photograph as the networks see it; ``side`` of the crop in pixels."""
    mask = np.asarray(view.clip.masks[view.row])
    crop = crop_around(mask, side)
    white = on_white(np.asarray(view.clip.frames[view.row]), mask)
    return Cut(view, crop, as_bytes(crop.of(white, WHITE)), float(mask.sum()))


def lpips_rows(
    subject: Subject,
    renderers: Mapping[str, Renderer],
    cuts: Sequence[Cut],
    lpips: LpipsAlex,
    side: int,
) -> list[ScoreRow]:
    """``lpips_alex`` of every view and method, over the crop on white; of a photograph it is 0."""
    protocol = f"crop {side} px on white; {lpips_protocol(lpips)}"
    rows = []
    for cut in cuts:
        reference = _features(cut.picture, lpips)
        seen = {method: _features(cut.render(r), lpips) for method, r in renderers.items()}
        for method, ours in {**seen, PHOTOGRAPH: reference}.items():
            distance = lpips.distance(ours, reference)
            rows.append(_row(subject, method, cut.view, LPIPS, distance, protocol))
    return rows


def person_rows(
    subject: Subject,
    renderers: Mapping[str, Renderer],
    cuts: Sequence[Cut],
    judge: PersonJudge,
    of_views: int,
) -> list[ScoreRow]:
    """``plausibility`` and ``oks`` of each method, and of the photographs themselves.

    A photograph's own OKS is 1 wherever it has one: it is compared with itself. What the detectors
    alone are off by shows in its copy that is shifted by half a pixel. Views whose photograph has
    no pose have no OKS; the protocol counts them.

    Args:
        cuts: the views that the detectors look at.
        of_views: how many views these were drawn from.
    """
    photographs = [cut.picture for cut in cuts]
    table = _Table(subject, cuts, judge, judge.look(photographs), of_views)
    sights = {
        PHOTOGRAPH: table.references,
        SHIFTED_PHOTOGRAPH: judge.look_shifted(photographs),
        **{name: judge.look([cut.render(r) for cut in cuts]) for name, r in renderers.items()},
    }
    return [
        row
        for method, seen in sights.items()
        for row in (*table.plausibility(method, seen), *table.oks(method, seen))
    ]


class NetworkCurve:
    """Means of the networks' scores over the same few views, again and again."""

    def __init__(self, views: Sequence[ScoredView], side: int, networks: Networks) -> None:
        """``side``: of the crop in pixels. The photographs are looked at once."""
        self._judge, self._lpips = networks
        self._cuts = [cut_of(view, side) for view in views]
        pictures = [cut.picture for cut in self._cuts]
        self._references = self._judge.look(pictures)
        self._features = [_features(picture, self._lpips) for picture in pictures]

    def means(self, renders: Sequence[NDArray[np.floating]]) -> dict[str, float]:
        """By metric; ``oks`` is left out where no photograph has a pose.

        Args:
            renders: (H, W, 3) over white, one of each view.
        """
        pictures = [cut.of(rgb) for cut, rgb in zip(self._cuts, renders, strict=True)]
        sights = self._judge.look(pictures)
        distances = [
            self._lpips.distance(_features(picture, self._lpips), reference)
            for picture, reference in zip(pictures, self._features, strict=True)
        ]
        similarities = [
            self._judge.similarity(sight, reference, cut.area_px)
            for sight, reference, cut in zip(sights, self._references, self._cuts, strict=True)
            if self._judge.has_reference(reference)
        ]
        found = {LPIPS: distances, PLAUSIBILITY: [float(sight.person) for sight in sights]}
        if similarities:
            found[OKS] = similarities
        return {metric: float(np.mean(values)) for metric, values in found.items()}


@dataclass(frozen=True, eq=False)
class _Table:
    """Turns sights into rows."""

    subject: Subject
    cuts: Sequence[Cut]
    judge: PersonJudge
    references: Sequence[Sight]  # of the photographs
    of_views: int

    def plausibility(self, method: str, sights: Sequence[Sight]) -> list[ScoreRow]:
        protocol = f"{self._pictures()}; {self.judge.plausibility_protocol()}"
        return [
            _row(self.subject, method, cut.view, PLAUSIBILITY, float(sight.person), protocol)
            for cut, sight in zip(self.cuts, sights, strict=True)
        ]

    def oks(self, method: str, sights: Sequence[Sight]) -> list[ScoreRow]:
        known = [self.judge.has_reference(reference) for reference in self.references]
        protocol = (
            f"{self._pictures()}; {self.judge.oks_protocol()}; {known.count(False)} of "
            f"{len(known)} views left out, no pose in the photograph"
        )
        return [
            _row(
                *(self.subject, method, cut.view, OKS),
                self.judge.similarity(sight, reference, cut.area_px),
                protocol,
            )
            for cut, sight, reference, counts in zip(
                self.cuts, sights, self.references, known, strict=True
            )
            if counts
        ]

    def _pictures(self) -> str:
        return (
            f"{len(self.cuts)} of {self.of_views} views, crop {self.cuts[0].crop.side} px on white"
        )


def _drawn(cuts: Sequence[Cut], count: int, seed: int) -> list[Cut]:
    named = {(cut.view.camera.name, cut.view.frame_index): cut for cut in cuts}
    return [named[name] for name in draw_views(list(named), count, seed)]


def _features(picture: Picture, lpips: LpipsAlex) -> list[Tensor]:
    return lpips.features(picture / np.float32(255.0))


def _row(
    subject: Subject, method: str, view: ScoredView, metric: str, value: float, protocol: str
) -> ScoreRow:
    where = (view.camera.name, view.frame_index)
    return ScoreRow(subject.scene, method, subject.seed, *where, metric, value, protocol)
