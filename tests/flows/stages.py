"""The stages of a run on the toy scene, in their order."""

from __future__ import annotations

STAGES = [
    "ingest_meshes",
    "inspect_scene",
    "extract_clip",
    "repair_body",
    "plan_scene",
    "pretrain_density",
    "fit_motion",
    "optimise_scene",
    "extract_evaluation",
    "render_views",
    "score_views",
    "write_report",
]
