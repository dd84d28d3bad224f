"""Laws of what networks say of misplaced photographs."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.metrics.misalignment import MISPLACEMENTS
from mocoflow_core.metrics.misplaced_persons import misplaced_person_rows
from mocoflow_core.metrics.perceptual import LpipsAlex
from mocoflow_core.metrics.person_judge import Networks, PersonJudge, PersonScoreConfig
from mocoflow_core.metrics.score import EvaluationConfig
from tests.dark_person import DarkPerson

SIDE = 96


def view(brightness: int) -> tuple[np.ndarray, np.ndarray]:
    """A block of one brightness in a picture of 128 x 128 pixels."""
    mask = np.zeros((128, 128), bool)
    mask[40:88, 52:76] = True
    return np.full((128, 128, 3), brightness, np.uint8), mask


@pytest.fixture(scope="module")
def rows():
    judge = PersonJudge(PersonScoreConfig(), DarkPerson(), DarkPerson())
    views = [view(0), view(255)]  # Nobody finds the white one.
    networks = Networks(judge, LpipsAlex())
    return misplaced_person_rows("scene", views, SIDE, EvaluationConfig(), networks)


def of(rows, metric: str, kind: str):
    return [row for row in rows if (row.metric, row.misplaced) == (metric, kind)]


def test_a_shifted_person_is_the_same_person_and_another_picture(rows):
    assert len(of(rows, "oks", "shifted") + of(rows, "oks", "turned")) == len(MISPLACEMENTS)
    for row in of(rows, "oks", "shifted"):
        assert row.value == pytest.approx(1.0, abs=0.02)
    distances = [row.value for row in of(rows, "lpips_alex", "shifted")]
    assert 0 < distances[0] < distances[-1]


def test_a_photograph_without_a_pose_is_no_view_of_oks_and_is_counted(rows):
    for row in of(rows, "oks", "shifted"):
        assert row.views == 1
        assert "1 of 2 views left out" in row.protocol
    for row in of(rows, "plausibility", "shifted"):
        assert (row.views, row.value) == (2, 0.5)
        assert "left out" not in row.protocol
