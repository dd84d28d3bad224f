"""What the stages before the optimisation have cost, for its training clock."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from pydantic import JsonValue

from mocoflow_core.artifacts import Artifact
from tasks.stage import Aside


def spent_on(artifacts: Iterable[Artifact], machine: Mapping[str, JsonValue]) -> Aside:
    """Seconds of the given stages, each counted once, as recorded when they were computed.

    With the machine that goes on from there. All of it stays out of the key: a slower machine
    does not make another scene.
    """
    once = {(artifact.stage, artifact.key): artifact for artifact in artifacts}.values()
    return Aside(
        {
            "wall_s": sum(a.wall_s for a in once),
            "cpu_s": sum(a.cpu_s for a in once),
            "machine": dict(machine),
        }
    )
