"""Distance of the visible surface from the true one, of the trained scene and the given mesh."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.rasterise import rasterise
from mocoflow_core.body.rasterise import surface_points as points_on_mesh
from mocoflow_core.methods.rendered_views import ScoredView, TrainedRenderer
from mocoflow_core.methods.scored_views import Subject
from mocoflow_core.methods.truth_file import read_truth
from mocoflow_core.metrics.surface import surface_mm
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.rendering.surface_points import surface_points

PROTOCOL = "mean distance in mm of the points that the view's pixels see from the true mesh"


def surface_rows(
    subject: Subject,
    renderer: TrainedRenderer,
    meshes: MeshSequence,
    views: Sequence[ScoredView],
    truth: Path,
) -> list[ScoreRow]:
    """``surface_mm`` of both methods at the given views; none where the truth has no surface."""
    known = read_truth(truth)
    if not {"vertices", "faces"} <= set(known):
        return []
    frames, vertices = known["frame_indices"], known["vertices"]
    faces = known["faces"].astype(np.int32)
    true_row = {int(frame): row for row, frame in enumerate(frames)}
    rows = []
    for view in views:
        if view.frame_index not in true_row:
            continue
        body = vertices[true_row[view.frame_index]]
        given = meshes.at(np.array([view.frame_index], np.int32)).vertices[0].astype(np.float64)
        raster = rasterise(given, meshes.faces, view.camera)
        seen = {
            "mocoflow": surface_points(
                renderer.scene, view.camera, renderer.time(view.frame_index)
            ).points,
            "posed_mesh": points_on_mesh(raster, view.camera),
        }
        for method, points in seen.items():
            if len(points):
                value = surface_mm(points, body, faces)
                where = (view.camera.name, view.frame_index, "surface_mm", value, PROTOCOL)
                rows.append(ScoreRow(subject.scene, method, subject.seed, *where))
    return rows
