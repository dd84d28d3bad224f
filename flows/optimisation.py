"""The optimisation itself, of whichever representation the request has chosen."""

from __future__ import annotations

from dataclasses import asdict

from flows.preparation import Preparation
from flows.request import Request
from mocoflow_core.artifacts import SceneArtifact
from tasks.optimise_scene import optimise_networks, optimise_scene
from tasks.stage import Aside


def optimise(request: Request, prepared: Preparation, before: Aside) -> SceneArtifact:
    """Train the scene, or find it in the store. ``before``: the training clock so far."""
    where, chosen = request.store, request.configuration
    devices = Aside(asdict(request.processes))
    schedule = chosen.schedule.joint()
    if chosen.representation == "networks":
        return optimise_networks(
            where,
            prepared.clip,
            prepared.plan,
            prepared.motion,
            before,
            devices,
            chosen.losses,
            schedule,
            request.seed,
        )
    return optimise_scene(
        where,
        prepared.clip,
        prepared.plan,
        prepared.density,
        prepared.motion,
        before,
        devices,
        chosen.canonical,
        chosen.motion,
        chosen.sampling,
        chosen.losses,
        schedule,
        request.seed,
    )
