"""Options of commands that take a bare video, as settings."""

from __future__ import annotations

from pathlib import Path

import typer

from mocoflow_core.errors import InputError

FOCAL_HELP = "Of a bare video: focal length in pixels of the video; by default found or guessed."
CLIP_HELP = "Of a bare video: the part from second START to END."
Focal = typer.Option("--focal", metavar="PX", help=FOCAL_HELP)
Clip = typer.Option("--clip", metavar="START-END", help=CLIP_HELP)


def is_bare_video(scene: Path) -> bool:
    """A file that is no scene.json: one that it is no video for shows when it is opened."""
    return scene.is_file() and scene.suffix.lower() != ".json"


def video_settings(
    focal: float | None, clip: str | None, person: int | None, part: str = ""
) -> list[str]:
    """The options as ``field=value`` of the video's configuration, below ``part``."""
    given = [] if focal is None else [f"{part}focal_px={focal}"]
    if person is not None:
        given.append(f"{part}person={person}")
    if clip is not None:
        start, end = _seconds(clip)
        given += [f"{part}start_s={start}", f"{part}end_s={end}"]
    return given


def _seconds(clip: str) -> tuple[float, float]:
    try:
        start, end = (float(part) for part in clip.split("-"))
    except ValueError:
        start, end = 0.0, 0.0
    if not 0 <= start < end:
        raise InputError("--clip START-END in seconds, as 5-20", repr(clip), "Write it so.")
    return start, end
