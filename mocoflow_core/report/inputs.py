"""What a report is made from: files of a finished run and a few plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from mocoflow_core.capture.clip import Clip

# Rows of this method are what the user had before: the given mesh, and its motion.
BASELINE = "posed_mesh"


@dataclass(frozen=True)
class ReportInputs:
    """Every part but ``run`` may be absent; the page then leaves its section out, or says why.

    ``run`` holds what ``run.json`` holds: scene, preset, seed, configuration, machine, stages
    [{name, wall_s, cpu_s, cached}], cameras; optional ``method`` (default ``mocoflow``),
    ``command``, ``license``, ``attribution`` and ``remarks``.
    """

    run: Mapping[str, Any]
    decisions: Sequence[Mapping[str, Any]] = ()  # of plan.json
    scores: Path | None = None  # scores.parquet
    curve: Path | None = None  # error_curve.parquet
    train_clip: Path | None = None  # folder of the saved Clip of the train camera
    evaluation: Path | None = None  # <camera>/ with a saved Clip each
    views: Path | None = None  # <camera>/%06d.png, over white
    baseline_views: Path | None = None  # the same of the posed mesh
    novel_camera: str = ""  # whose side the novel view shows
    novel_view: Path | None = None  # %06d.png, one for each frame of the train clip
    correspondences: Path | None = None  # %06d.png of frames of the train clip
    canonical_frame: int | None = None  # source number
    turntable: Path | None = None  # an H.264 mp4
    warnings: Sequence[str] = ()
    guard_events: Sequence[str] = ()  # steps refused, states restored
    held_out: str = ""  # which pixels of the train camera scored the run while it went on

    @property
    def method(self) -> str:
        """The method whose run this is."""
        return str(self.run.get("method", "mocoflow"))

    @cached_property
    def seen(self) -> Clip | None:
        """What the train camera saw."""
        return None if self.train_clip is None else Clip.load(self.train_clip)

    @property
    def train_camera(self) -> str:
        """Name of the camera that was trained on; empty where nothing says it."""
        return self.seen.camera.name if self.seen else str(self.run.get("train_camera", ""))
