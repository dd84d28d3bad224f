"""Where the files of one AIST sequence lie: videos in a flat folder, annotations in their tree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mocoflow_core.datasets.aist_names import AistName, parse_name
from mocoflow_core.datasets.links import links_below
from mocoflow_core.errors import InputError

VIDEO_SUFFIX = ".mp4"
CAMERAS = 9
# Beside or inside the folder that the user points at.
_ANNOTATION_FOLDERS = (".", "annotations", "aist_plusplus_final")
_VIDEO_FOLDERS = (".", "videos")


@dataclass(frozen=True)
class AistFiles:
    """Files of one sequence; not all need exist."""

    name: AistName
    videos: Path
    annotations: Path

    @property
    def cameras(self) -> Path:
        return self.annotations / "cameras"

    @property
    def motion(self) -> Path:
        return self.annotations / "motions" / f"{self.name.sequence}.pkl"

    @property
    def keypoints(self) -> Path:
        return self.annotations / "keypoints3d" / f"{self.name.sequence}.pkl"

    @property
    def ignore_list(self) -> Path:
        return self.annotations / "ignore_list.txt"

    @property
    def recordings(self) -> list[Path]:
        """The videos of all cameras."""
        return [self.video(f"c{number:02d}") for number in range(1, CAMERAS + 1)]

    @property
    def annotated(self) -> list[Path]:
        """The annotations; of the cameras their folder and what in it is a link."""
        linked = links_below(self.cameras) if self.cameras.is_dir() else ()
        return [self.cameras, *linked, self.motion, self.keypoints, self.ignore_list]

    def video(self, camera: str) -> Path:
        return self.videos / f"{self.name.video(camera)}{VIDEO_SUFFIX}"


def find_files(
    source: Path, sequence: str | None, videos: Path | None, annotations: Path | None
) -> AistFiles:
    """The files behind ``source``: a folder with both, with the videos alone, or one video.

    Raises InputError when the sequence is not said by anything, and for missing folders.
    """
    folder = source.parent if source.is_file() else source
    videos = videos or find_videos(folder)
    annotations = annotations or _with_annotations([folder, folder.parent, videos.parent])
    if sequence is None and source.is_file():
        sequence = source.name
    return AistFiles(_name(sequence, videos), videos, annotations)


def missing_parts(folder: Path) -> list[str]:
    """What a folder lacks to hold AIST videos with their annotations, in words."""
    parts = {
        "videos (*.mp4, named as gBR_sBM_c01_d04_mBR0_ch01.mp4)": _videos_in(folder),
        "the AIST++ annotations (cameras/mapping.txt)": _annotations_in(folder),
    }
    return [what for what, found in parts.items() if found is None]


def _annotations_in(folder: Path) -> Path | None:
    places = (folder / part for part in _ANNOTATION_FOLDERS)
    return next((place for place in places if (place / "cameras/mapping.txt").is_file()), None)


def _videos_in(folder: Path) -> Path | None:
    return next((folder / part for part in _VIDEO_FOLDERS if any(_listed(folder / part))), None)


def _with_annotations(near: list[Path]) -> Path:
    for found in map(_annotations_in, near):
        if found:
            return found
    raise InputError(
        "the AIST++ annotations (a folder with cameras/mapping.txt)",
        f"none in or beside {near[0]}",
        "Unpack them there, or name their folder with the field annotations.",
    )


def find_videos(folder: Path) -> Path:
    """The folder of the videos, in or below one. Raises InputError where there is none."""
    if found := _videos_in(folder):
        return found
    raise InputError(
        f"AIST videos ({VIDEO_SUFFIX}) in one flat folder",
        f"none in {folder}",
        "Download them from aistdancedb.ongaaccel.jp, or name their folder with the field videos.",
    )


def _listed(folder: Path) -> Iterator[Path]:
    return folder.glob(f"g*{VIDEO_SUFFIX}") if folder.is_dir() else iter(())


def sequences_in(videos: Path) -> list[str]:
    """Names of the sequences of which a folder holds videos."""
    return sorted({parse_name(path.name).sequence for path in _listed(videos)})


def _name(sequence: str | None, videos: Path) -> AistName:
    if sequence is not None:
        return parse_name(sequence)
    sequences = sequences_in(videos)
    if len(sequences) != 1:
        few = ", ".join(sequences[:3])
        raise InputError(
            "one sequence",
            f"{len(sequences)} in {videos.name} ({few}{', ...' if len(sequences) > 3 else ''})",
            "Choose one with the field sequence.",
        )
    return parse_name(sequences[0])
