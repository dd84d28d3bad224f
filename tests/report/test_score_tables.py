from __future__ import annotations

import pytest

from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.report.score_tables import headlines, repairs, view_table


def score(method: str, camera: str, metric: str, *values: float) -> list[ScoreRow]:
    return [
        ScoreRow("s", method, 0, camera, frame, metric, value, "white")
        for frame, value in enumerate(values)
    ]


ROWS = [
    *score("mocoflow", "cam00", "psnr_union", 30.0),
    *score("mocoflow", "cam01", "psnr_union", 20.0, 22.0),
    *score("mocoflow", "cam02", "psnr_union", 24.0),
    *score("posed_mesh", "cam01", "psnr_union", 18.0, 18.0),
    *score("posed_mesh", "cam02", "psnr_union", 25.0),
    *score("mocoflow", "cam00", "keypoint_mm", 40.0, 45.0, 400.0),
    *score("posed_mesh", "cam00", "keypoint_mm", 50.0, 60.0, 50.0),
]


def test_held_out_cameras_come_first_together_and_the_train_camera_last() -> None:
    groups = view_table(ROWS, "cam00").groups
    assert [group[0].camera for group in groups] == [
        "all 2 held-out cameras",
        "cam01",
        "cam02",
        "cam00, held-out frames",
    ]
    assert groups[0][0].cells[0].text == "22.00"
    assert groups[0][0].views == 3


def test_the_best_method_of_each_camera_is_marked_even_when_it_is_the_baseline() -> None:
    groups = view_table(ROWS, "cam00").groups
    best = {row.camera: row.method for group in groups for row in group if row.cells[0].best}
    assert best == {
        "all 2 held-out cameras": "mocoflow",
        "cam01": "mocoflow",
        "cam02": "posed_mesh",
    }


def test_errors_of_the_body_are_compared_by_their_medians() -> None:
    (repair,) = repairs(ROWS, "mocoflow")
    assert (repair.before, repair.after, repair.change) == ("50.0 mm", "45.0 mm", "-10 %")
    assert repair.better


def test_no_change_is_claimed_against_an_error_of_zero_or_below_the_digits() -> None:
    exact = score("posed_mesh", "cam00", "surface_mm", 1e-6)
    assert (
        repairs(exact + score("mocoflow", "cam00", "surface_mm", 0.8), "mocoflow")[0].change == ""
    )
    before = score("posed_mesh", "cam00", "surface_mm", 12.01)
    assert (
        repairs(before + score("mocoflow", "cam00", "surface_mm", 12.02), "mocoflow")[0].change
        == ""
    )


def test_key_numbers_are_of_held_out_cameras_and_never_of_the_train_camera() -> None:
    numbers = {number.title: number for number in headlines(ROWS, "mocoflow", "cam00")}
    assert numbers["PSNR, person"].value == "22.00"
    assert numbers["PSNR, person"].note == "posed mesh 20.33"
    assert numbers["keypoints"].value == "45.0"


def test_without_other_cameras_the_held_out_frames_are_the_key_numbers() -> None:
    alone = [row for row in ROWS if row.camera == "cam00"]
    assert headlines(alone, "mocoflow", "cam00")[0].value == "30.00"


@pytest.mark.parametrize("rows", [[], score("posed_mesh", "cam01", "psnr_union", 1.0)])
def test_a_run_without_scores_of_its_own_has_no_key_numbers(rows: list[ScoreRow]) -> None:
    assert headlines(rows, "mocoflow", "cam00") == []


def test_key_numbers_stand_beside_what_photographs_reach() -> None:
    rows = [
        *score("mocoflow", "cam01", "oks", 0.8),
        *score("photograph", "cam01", "oks", 1.0),
        *score("shifted_photograph", "cam01", "oks", 0.97),
        *score("mocoflow", "cam01", "plausibility", 0.5),
        *score("photograph", "cam01", "plausibility", 0.75),
        *score("shifted_photograph", "cam01", "plausibility", 1.0),
    ]
    notes = {found.title: found.note for found in headlines(rows, "mocoflow", "cam00")}
    assert notes == {"OKS": "shifted photographs 0.970", "plausibility": "photographs 0.75"}
    (group,) = view_table(rows, "cam00").groups
    assert not any(cell.best for row in group for cell in row.cells)
