"""Flow plan: everything before the optimisation, and what both of them need."""

from __future__ import annotations

from pathlib import Path

from prefect import flow

from flows.plan_table import show_plan
from flows.preparation import prepare
from flows.request import Request
from mocoflow_core.planning.plan import ScenePlan
from mocoflow_core.presets import Preset


@flow(name="plan", validate_parameters=True)
def plan(
    scene: Path,
    preset: Preset = "fast",
    meshes: Path | None = None,
    settings: tuple[str, ...] = (),
    store: str | None = None,
) -> ScenePlan:
    """Prepare a scene and say what it needs; a reconstruction of it goes on from there.

    Args:
        scene: folder with a scene.json.
        preset: complete configuration to start from.
        meshes: body meshes to use instead of the scene's own: an estimator's file or folder.
        settings: single fields, such as ``plan.motion_residual=off``.
        store: folder or fsspec address of the artifact store.
    """
    request = Request(
        scene_path=scene, preset=preset, meshes=meshes, settings=settings, store_url=store
    )
    return show_plan(request, prepare(request).plan)
