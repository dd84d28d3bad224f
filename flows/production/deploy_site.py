"""Bring this machine's site up to date with all that it was and is told, and keep that."""

from __future__ import annotations

import subprocess
import sys

from flows.production.processes import is_running
from flows.production.settings import FIXED, keep, kept, told
from flows.production.site import Site
from mocoflow_core.errors import InputError


def deploy_site(site: Site) -> None:
    """Deploy in a process of its own, as Prefect reads its settings when it is imported.

    Raises InputError where the running worker was told something else, and RuntimeError after
    words of that process, where it fails; what was told before stays then.
    """
    require_the_same_worker(site)
    words = [sys.executable, "-m", "flows.production", "deploy", "--state", str(site.folder)]
    if subprocess.run(words, env=site.environment()).returncode != 0:
        raise RuntimeError("what is written above kept the deployments from being made")
    keep(site.folder, told(site.folder))


def require_the_same_worker(site: Site) -> None:
    """A schedule that is due would otherwise find a worker without the data set's root."""
    if not is_running(site, "worker"):
        return
    before, now = kept(site.folder), told(site.folder)
    differ = [name for name in FIXED if before.get(name) != now.get(name)]
    if differ:
        raise InputError(
            "the settings that the running worker was started with",
            f"another {', '.join(differ)}",
            "Take it down first: make down.",
        )
