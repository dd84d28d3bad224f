"""The data sets that can be read, by the names that users write."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets.aist import read_aist
from mocoflow_core.datasets.aist_configuration import AistConfig
from mocoflow_core.datasets.aist_files import missing_parts as missing_in_aist
from mocoflow_core.datasets.dataset_scene import DatasetScene
from mocoflow_core.datasets.people_snapshot import PeopleSnapshotConfig, read_people_snapshot
from mocoflow_core.datasets.snapshot_files import missing_parts as missing_in_people_snapshot
from mocoflow_core.datasets.zju_annotations import missing_parts as missing_in_zju_mocap
from mocoflow_core.datasets.zju_mocap import ZjuMocapConfig, read_zju_mocap


@dataclass(frozen=True)
class DatasetKind:
    """One data set: how it is recognised, configured and read."""

    name: str
    configuration: type[ConfigurationPart]
    read: Callable[[Path, Any], DatasetScene]  # a folder and that configuration
    missing: Callable[[Path], list[str]]  # what a folder lacks to be of this kind, in words


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
    )
}
