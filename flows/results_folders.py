"""Where a run's results go when nobody has said it: a folder that is named after the run."""

from __future__ import annotations

import re
from pathlib import Path

from prefect.runtime import flow_run

from flows.allowed_folders import AllowedFolders
from flows.user_folders import results_folder


def folder_of_this_run() -> Path:
    """``<results>/<flow>/<run>-<id>`` of the flow run that this is called in.

    Results are in ``MOCOFLOW_RESULTS_ROOT``, else in the user's data. A run that is tried again
    finds its folder.
    """
    root = AllowedFolders.of_environment().results or results_folder()
    name = re.sub(r"[^A-Za-z0-9.-]+", "-", flow_run.name or "run").strip("-.")
    return root / str(flow_run.flow_name) / f"{name}-{str(flow_run.id)[:8]}"
