"""Where the public data sets lie on this machine: one environment variable for each."""

from __future__ import annotations

import os
from pathlib import Path

from mocoflow_core.errors import InputError

ROOTS = {
    "aist": "MOCOFLOW_AIST_ROOT",
    "zju-mocap": "MOCOFLOW_ZJU_MOCAP_ROOT",
    "people-snapshot": "MOCOFLOW_PEOPLE_SNAPSHOT_ROOT",
}


def configured_roots() -> dict[str, Path]:
    """The folders of those data sets whose variable is set, by the data set's name."""
    given = {name: os.environ.get(variable) for name, variable in ROOTS.items()}
    return {name: Path(root) for name, root in given.items() if root}


def root_of(data_set: str) -> Path:
    """The folder of a data set. Raises InputError where it is not told, or is no folder."""
    variable, root = ROOTS[data_set], configured_roots().get(data_set)
    if root is None:
        raise InputError(
            f"The data set {data_set} needs its folder in {variable}",
            "nothing there",
            f"Set {variable} where the run's worker starts; docs/datasets says what lies in it.",
        )
    if not root.is_dir():
        raise InputError(f"{variable} must be a folder", str(root), "Check the path.")
    return root
