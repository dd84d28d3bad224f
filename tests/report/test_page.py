from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mocoflow_core.capture.clip import Clip
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.io.video import write_video
from mocoflow_core.metrics.curve import CurveRow, write_curve
from mocoflow_core.metrics.table import ScoreRow, write_scores
from mocoflow_core.report.inputs import ReportInputs
from mocoflow_core.report.page import write_report
from mocoflow_core.report.template import seconds_text

SIZE = 40
FRAMES = [4, 9, 14]
RUN = {
    "scene": "turn <script>",
    "preset": "toy",
    "seed": 3,
    "remarks": ["its bodies were fitted to all views"],
    "configuration": {"sampling": {"rays": 64}},
    "machine": {"cores": 2, "threads": 1},
    "stages": [
        {"name": "extract_clip", "wall_s": 2.0, "cpu_s": 2.5, "cached": True},
        {"name": "optimise_scene", "wall_s": 70.0, "cpu_s": 80.0, "cached": False},
    ],
}
DECISION = {
    "name": "location_search",
    "needed": False,
    "reason": "the meshes bring a location",
    "evidence": {"overlap": 0.91234},
    "threshold": 0.6,
    "saves": "the grid search",
}


def save_clip(folder: Path, name: str, held_out: list[bool]) -> None:
    rng = np.random.default_rng(0)
    masks = np.zeros((3, SIZE, SIZE), bool)
    masks[:, 10:30, 15:25] = True
    folder.mkdir(parents=True)
    Clip(
        camera=Camera(name, SIZE, SIZE, np.diag([50.0, 50, 1]), np.eye(3), np.zeros(3)),
        fps=5.0,
        frame_indices=np.array(FRAMES, np.int32),
        frames=rng.integers(0, 256, (3, SIZE, SIZE, 3), dtype=np.uint8),
        masks=masks,
        has_mask=np.ones(3, bool),
        held_out=np.array(held_out),
        background=np.zeros((SIZE, SIZE, 3), np.uint8),
    ).save(folder)


def save_views(folder: Path) -> None:
    folder.mkdir(parents=True)
    for index in FRAMES:
        picture = np.full((SIZE, SIZE, 3), 255, np.uint8)
        picture[12:28, 14:24] = 90
        Image.fromarray(picture).save(folder / f"{index:06d}.png")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    root = tmp_path_factory.mktemp("run")
    save_clip(root / "clip", "cam00", [False, True, False])
    save_clip(root / "evaluation/cam01", "cam01", [False] * 3)
    for camera in ("cam00", "cam01"):
        save_views(root / "views" / camera)
        save_views(root / "baseline" / camera)
    save_views(root / "correspondences")
    write_video(root / "turntable.mp4", np.zeros((4, SIZE, SIZE, 3), np.uint8), 5.0)
    scores = [
        ScoreRow("turn", method, 3, camera, index, metric, value + 0.01 * index, "crop 60 px")
        for method, value in (("mocoflow", 20.0), ("posed_mesh", 17.0))
        for camera in ("cam00", "cam01")
        for index in FRAMES
        for metric in ("psnr_union", "mask_iou", "keypoint_mm")
    ]
    write_scores(scores, root / "scores.parquet")
    curve = [
        CurveRow(
            "turn", "mocoflow", 3, "optimise_scene", 10 * k, 3.0 * k, 4.0 * k, "psnr_union", 18 + k
        )
        for k in range(1, 5)
    ]
    write_curve(curve, root / "error_curve.parquet")
    return ReportInputs(
        run=RUN,
        decisions=[DECISION],
        scores=root / "scores.parquet",
        curve=root / "error_curve.parquet",
        train_clip=root / "clip",
        evaluation=root / "evaluation",
        views=root / "views",
        baseline_views=root / "baseline",
        novel_camera="cam01",
        novel_view=root / "views/cam01",
        correspondences=root / "correspondences",
        canonical_frame=9,
        turntable=root / "turntable.mp4",
        warnings=["the height of 2.4 m is unusual"],
        guard_events=["step 12 refused"],
        held_out="640 pixels of 8 held-out frames of cam00",
    )


def page_of(inputs: ReportInputs, folder: Path) -> str:
    write_report(inputs, folder / "report.html")
    return (folder / "report.html").read_text()


class References(HTMLParser):
    """Every address that a page asks a browser to open."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.open_tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.found += [value for name, value in attrs if name in ("src", "href", "poster")]
        if tag not in ("meta", "img", "input", "br"):
            self.open_tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open_tags.pop() == tag


def test_the_page_asks_for_nothing_beside_itself(inputs: ReportInputs, tmp_path: Path) -> None:
    page = page_of(inputs, tmp_path)
    references = References()
    references.feed(page)
    assert references.open_tags == []
    outside = [u for u in references.found if not u.startswith(("data:", "#"))]
    assert outside == []
    assert "url(http" not in page
    assert "@import" not in page


def test_every_part_of_a_whole_run_is_on_the_page(inputs: ReportInputs, tmp_path: Path) -> None:
    page = page_of(inputs, tmp_path)
    for text in (
        "seed 3",
        "its bodies were fitted to all views",
        "cam00, held-out frames",
        "crop 60 px",
        "the meshes bring a location",
        "overlap 0.912",
        "from the cache",
        "1 min 12 s",
        "unusual",
        "step 12 refused",
        "640 pixels of 8 held-out frames of cam00",
        "Turntable",
        "Same colour, same point",
        "Did the optimisation repair",
        "&#34;rays&#34;: 64",
        "<svg",
    ):
        assert text in page, text


def test_names_from_files_cannot_become_markup(inputs: ReportInputs, tmp_path: Path) -> None:
    page = page_of(inputs, tmp_path)
    assert "turn <script>" not in page
    assert "turn &lt;script&gt;" in page


def test_train_frames_are_shown_only_where_they_were_held_out(
    inputs: ReportInputs, tmp_path: Path
) -> None:
    page = page_of(inputs, tmp_path)
    moments = re.findall(r'data-moment="(frame \d+) · (\d+ of \d+)"', page)
    assert moments[:3] == [(f"frame {i}", f"{n} of 3") for n, i in enumerate(FRAMES, 1)]
    assert moments[3:] == [("frame 9", "1 of 1")]


def test_correspondences_begin_with_the_canonical_frame(
    inputs: ReportInputs, tmp_path: Path
) -> None:
    page = page_of(inputs, tmp_path)
    assert re.findall(r'alt="places on the body, frame (\d+)"', page) == ["9", "4", "14"]
    assert re.findall(r"<h4>canonical, frame (\d+)</h4>", page) == ["9"]


def test_a_run_without_anything_but_its_name_still_has_a_page(tmp_path: Path) -> None:
    page = page_of(ReportInputs({"scene": "bare"}), tmp_path)
    assert "no held-out views" in page
    assert "<svg" not in page
    assert "<video" not in page
    assert "Correspondences" not in page


def test_the_same_run_gives_the_same_page(inputs: ReportInputs, tmp_path: Path) -> None:
    # The videos' container may hold a moment of writing, the rest may not.
    def still(page: str) -> str:
        return re.sub(r"data:video/mp4;base64,[^\"]*", "", page)

    assert still(page_of(inputs, tmp_path)) == still(page_of(inputs, tmp_path))


def test_the_videos_are_whole_files(inputs: ReportInputs, tmp_path: Path) -> None:
    page = page_of(inputs, tmp_path)
    videos = re.findall(r"data:video/mp4;base64,([^\"]*)", page)
    assert len(videos) == 2
    assert base64.b64decode(videos[1]) == inputs.turntable.read_bytes()


def test_seconds_are_written_for_people() -> None:
    texts = [seconds_text(s) for s in (0.04, 9.94, 9.96, 59.6, 200, 7500)]
    assert texts == ["0.0 s", "9.9 s", "10 s", "1 min 00 s", "3 min 20 s", "2 h 05 min"]
