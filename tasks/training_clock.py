"""What the stages before the optimisation have cost, for its training clock."""

from __future__ import annotations

from mocoflow_core.artifacts import Artifact
from mocoflow_core.training.clock import Seconds


def spent_on(*artifacts: Artifact) -> Seconds:
    """Seconds of the given stages, each counted once, as recorded when they were computed."""
    once = {(artifact.stage, artifact.key): artifact for artifact in artifacts}
    return sum((Seconds(a.wall_s, a.cpu_s) for a in once.values()), Seconds())
