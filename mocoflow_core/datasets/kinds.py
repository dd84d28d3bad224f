"""The data sets that can be read, by the names that users write."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets.aist import read_aist
from mocoflow_core.datasets.aist_configuration import AistConfig
from mocoflow_core.datasets.aist_files import missing_parts as missing_in_aist
from mocoflow_core.datasets.bare_video import missing_in_video, read_bare_video
from mocoflow_core.datasets.dataset_scene import DatasetScene
from mocoflow_core.datasets.people_snapshot import PeopleSnapshotConfig, read_people_snapshot
from mocoflow_core.datasets.snapshot_files import missing_parts as missing_in_people_snapshot
from mocoflow_core.datasets.zju_annotations import missing_parts as missing_in_zju_mocap
from mocoflow_core.datasets.zju_mocap import ZjuMocapConfig, read_zju_mocap
from mocoflow_core.progress import Progress
from mocoflow_core.video.configuration import VideoConfig


@dataclass(frozen=True)
class DatasetKind:
    """One data set: how it is recognised, configured and read."""

    name: str
    configuration: type[ConfigurationPart]
    read: Callable[[Path, Any], DatasetScene]  # a folder and that configuration
    missing: Callable[[Path], list[str]]  # what a source lacks to be of this kind, in words
    source: Literal["folder", "file"] = "folder"
    # As ``read``, for kinds that take minutes: says how far it is.
    read_telling: Callable[[Path, Any, Progress], DatasetScene] | None = None

    def open(
        self, path: Path, configuration: ConfigurationPart, progress: Progress | None
    ) -> DatasetScene:
        """The recording in memory. Raises InputError as the reader does."""
        if self.read_telling and progress:
            return self.read_telling(path, configuration, progress)
        return self.read(path, configuration)


KINDS = {
    kind.name: kind
    for kind in (
        DatasetKind(
            "people-snapshot",
            PeopleSnapshotConfig,
            read_people_snapshot,
            missing_in_people_snapshot,
        ),
        DatasetKind("zju-mocap", ZjuMocapConfig, read_zju_mocap, missing_in_zju_mocap),
        DatasetKind("aist", AistConfig, read_aist, missing_in_aist),
        DatasetKind(
            "video",
            VideoConfig,
            read_bare_video,
            missing_in_video,
            source="file",
            read_telling=read_bare_video,
        ),
    )
}
