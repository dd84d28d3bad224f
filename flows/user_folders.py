"""Where a user's programs keep what can be made again, and what was put there once."""

from __future__ import annotations

import os
from pathlib import Path

from mocoflow_core.io.machine import machine_id


def cache_folder() -> Path:
    """mocoflow's folder in the user's cache (``XDG_CACHE_HOME``, by default ``~/.cache``)."""
    cache = os.environ.get("XDG_CACHE_HOME")
    return (Path(cache) if cache else Path.home() / ".cache") / "mocoflow"


def body_models_folder() -> Path:
    """Where body models lie that no option names (``XDG_DATA_HOME``, else ``~/.local/share``)."""
    return _data_folder() / "body_models"


def results_folder() -> Path:
    """Where runs leave their results when neither they nor the worker name a place."""
    return _data_folder() / "results"


def data_folder() -> Path:
    """Where scenes of deployed runs lie when their worker is told no other place."""
    return _data_folder() / "data"


def this_machine() -> str:
    """What tells this machine from others (``XDG_STATE_HOME``, by default ``~/.local/state``)."""
    state = os.environ.get("XDG_STATE_HOME")
    folder = Path(state) if state else Path.home() / ".local" / "state"
    return machine_id(folder / "mocoflow" / "machine-id")


def _data_folder() -> Path:
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "mocoflow"
