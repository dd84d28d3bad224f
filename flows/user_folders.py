"""Where a user's programs keep what can be made again."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path:
    """mocoflow's folder in the user's cache (``XDG_CACHE_HOME``, by default ``~/.cache``)."""
    cache = os.environ.get("XDG_CACHE_HOME")
    return (Path(cache) if cache else Path.home() / ".cache") / "mocoflow"
