from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.methods.person_scores import (
    PHOTOGRAPH,
    SHIFTED_PHOTOGRAPH,
    NetworkCurve,
    cut_of,
    lpips_rows,
    person_rows,
)
from mocoflow_core.methods.rendered_views import ScoredView
from mocoflow_core.methods.scored_views import Moment, Subject, error_curve, score_views, side_of
from mocoflow_core.metrics.perceptual import LpipsAlex
from mocoflow_core.metrics.person_judge import Networks, PersonJudge, PersonScoreConfig
from mocoflow_core.metrics.score import EvaluationConfig
from tests.dark_person import DarkPerson

SIDE = 50
SUBJECT = Subject("scene", 3)


def clip() -> Clip:
    """Two frames of a black block before grey; in the second one the block is white."""
    camera = Camera("cam01", 60, 60, np.eye(3), np.eye(3), np.zeros(3))
    frames = np.full((2, 60, 60, 3), 90, np.uint8)
    masks = np.zeros((2, 60, 60), bool)
    masks[:, 10:50, 20:40] = True
    frames[masks] = 0
    frames[1, masks[1]] = 255
    every, numbers = np.ones(2, bool), np.array([4, 9], np.int32)
    return Clip(camera, 12.0, numbers, frames, masks, every, every, frames[0])


class Photograph:
    """The method that shows what the photographs show, moved to the right."""

    def __init__(self, seen: Clip, by_px: int = 0) -> None:
        self._seen, self._by_px = seen, by_px

    def render(self, camera: Camera, frame_index: int) -> tuple[np.ndarray, np.ndarray]:
        row = self._seen.frame_indices.tolist().index(frame_index)
        mask = np.roll(self._seen.masks[row], self._by_px, axis=1)
        rgb = np.roll(self._seen.frames[row], self._by_px, axis=1) / np.float32(255)
        return np.where(mask[..., None], rgb, np.float32(1)), mask.astype(np.float32)


@pytest.fixture
def seen() -> Clip:
    return clip()


@pytest.fixture
def rows(seen):
    cuts = [cut_of(ScoredView(seen, row), SIDE) for row in range(2)]
    blank = replace(seen, frames=np.full_like(seen.frames, 255))
    methods = {"same": Photograph(seen), "moved": Photograph(seen, 4), "blank": Photograph(blank)}
    judge = PersonJudge(PersonScoreConfig(), DarkPerson(), DarkPerson())
    return person_rows(SUBJECT, methods, cuts, judge, of_views=7)


def values(rows, method: str, metric: str) -> dict[int, float]:
    return {r.frame_index: r.value for r in rows if (r.method, r.metric) == (method, metric)}


def test_plausibility_is_of_every_view_and_oks_where_the_photograph_has_a_pose(rows):
    assert values(rows, "same", "plausibility") == {4: 1.0, 9: 0.0}
    assert values(rows, "same", "oks") == {4: 1.0}


def test_a_shift_costs_no_oks_and_a_missing_person_all_of_it(rows):
    assert values(rows, "moved", "oks")[4] == pytest.approx(1.0, abs=1e-5)
    assert values(rows, "blank", "oks") == {4: 0.0}
    assert values(rows, "blank", "plausibility") == {4: 0.0, 9: 0.0}


def test_the_photographs_are_scored_beside_the_methods(rows):
    assert values(rows, PHOTOGRAPH, "plausibility") == {4: 1.0, 9: 0.0}
    assert values(rows, PHOTOGRAPH, "oks") == {4: 1.0}
    assert values(rows, SHIFTED_PHOTOGRAPH, "plausibility") == {4: 1.0, 9: 0.0}
    assert 0.9 < values(rows, SHIFTED_PHOTOGRAPH, "oks")[4] < 1.0


def test_pairs_left_out_and_views_drawn_are_counted_in_the_protocol(rows):
    (said,) = {row.protocol for row in rows if row.metric == "oks"}
    assert "2 of 7 views" in said
    assert "1 of 2 views left out" in said
    assert f"crop {SIDE} px" in said


def test_lpips_of_the_photograph_itself_is_zero(seen):
    cuts = [cut_of(ScoredView(seen, 0), SIDE)]
    methods = {"same": Photograph(seen), "moved": Photograph(seen, 4)}
    rows = lpips_rows(SUBJECT, methods, cuts, LpipsAlex(), SIDE)
    assert values(rows, "same", "lpips_alex")[4] == 0.0
    assert values(rows, PHOTOGRAPH, "lpips_alex")[4] == 0.0
    assert values(rows, "moved", "lpips_alex")[4] > 0.01


def test_along_the_curve_networks_say_what_they_say_at_the_end(seen):
    views, evaluating = [ScoredView(seen, row) for row in range(2)], EvaluationConfig()
    side = side_of(views, evaluating)
    networks = Networks(PersonJudge(PersonScoreConfig(), DarkPerson(), DarkPerson()), LpipsAlex())
    moment = Moment("mocoflow", "optimise_scene", 7, 2.0, 1.0, Photograph(seen, 4))
    looking = NetworkCurve(views, side, networks)
    rows = error_curve(SUBJECT, [moment], views, evaluating, lambda *_: None, looking)
    found = {row.metric: row.value for row in rows}
    cuts, methods = [cut_of(view, side) for view in views], {"mocoflow": moment.renderer}
    ended = [
        *lpips_rows(SUBJECT, methods, cuts, networks.lpips, side),
        *person_rows(SUBJECT, methods, cuts, networks.judge, 2),
        *score_views(SUBJECT, "mocoflow", views, moment.renderer, evaluating),
    ]
    for metric in ("lpips_alex", "plausibility", "oks", "psnr", "mask_iou"):
        at_the_end = list(values(ended, "mocoflow", metric).values())
        assert found[metric] == pytest.approx(np.mean(at_the_end))
    plain = error_curve(SUBJECT, [moment], views, evaluating, lambda *_: None)
    assert {row.metric for row in rows} - {row.metric for row in plain} == {
        "lpips_alex",
        "plausibility",
        "oks",
    }
