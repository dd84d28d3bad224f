"""Bodies from what a tool stored: its vertices, or pose and shape of a body model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.placement import middles

Array = NDArray[np.float64]

# A model that gives a tool's own vertices gives them to float32; another gender, another version
# or another topology is off by centimetres.
SAME_BODY_M = 0.005
COMPARED_FRAMES = 5


@dataclass(frozen=True, eq=False)
class Bodies:
    """Vertices (T, V, 3) in metres and faces (F, 3), and what was done to get them."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    remarks: tuple[str, ...] = ()


def shapes_of(betas: Array, context: EstimateContext) -> tuple[Array, tuple[str, ...]]:
    """The shape (S,) of the person, or one per frame (T, S), as chosen."""
    if context.chosen.shape == "per_frame":
        return betas, ()
    wobble = float(np.ptp(betas, axis=0).max(initial=0.0))
    if wobble == 0:
        return betas[0], ()
    return np.median(betas, axis=0), (
        f"one body shape for all frames, the median: the estimate's varies by up to {wobble:.2g}",
    )


def modelled(
    tool: str, pose: Array, betas: Array, context: EstimateContext, translation: Array | None = None
) -> Bodies:
    """Bodies posed with the user's SMPL model; pose (T, 24, 3) or matrices (T, 24, 3, 3).

    Raises InputError without the model.
    """
    model = context.require_model(tool, "SMPL")
    shape, remarks = shapes_of(fitting_shapes(betas, model), context)
    vertices = posed_vertices(model, pose, shape, translation, progress=context.progress)
    return Bodies(vertices.astype(np.float32), model.faces.astype(np.int32), remarks)


def stored(
    tool: str, vertices: Array, pose: Array | None, betas: Array | None, context: EstimateContext
) -> Bodies:
    """A tool's own vertices; with a body model at hand, of one shape and where they stood.

    Raises InputError without faces.
    """
    faces = context.faces(tool, vertices.shape[1])
    own = Bodies(vertices.astype(np.float32), faces)
    model = context.model
    whole = model is not None and len(model.parents) == 24
    if context.chosen.shape == "per_frame" or pose is None or betas is None:
        return own
    if not whole or model is None:
        note = "body shapes vary as the estimate's do: one shape for all needs --body-model"
        return Bodies(own.vertices, faces, (note,) if np.ptp(betas, axis=0).any() else ())
    betas = fitting_shapes(betas, model)
    off_m = _difference_m(model, vertices, pose, betas)
    if off_m > SAME_BODY_M:
        note = (
            f"the body model gives bodies that differ from the estimate's by {1000 * off_m:.0f} mm "
            "(another gender or version?): the estimate's are kept, shapes as they vary"
        )
        return Bodies(own.vertices, faces, (note,))
    shape, remarks = shapes_of(betas, context)
    if shape.ndim == 1 and not remarks:
        return own
    bodies = posed_vertices(model, pose, shape, progress=context.progress)
    bodies = bodies + (middles(vertices) - middles(bodies))[:, None]
    return Bodies(bodies.astype(np.float32), faces, remarks)


def _difference_m(model: SmplModel, vertices: Array, pose: Array, betas: Array) -> float:
    """Largest distance between a tool's bodies and the model's, each about its middle."""
    rows = np.linspace(0, len(vertices) - 1, min(COMPARED_FRAMES, len(vertices))).astype(int)
    ours = posed_vertices(model, pose[rows], betas[rows])
    apart = (ours - middles(ours)[:, None]) - (vertices[rows] - middles(vertices[rows])[:, None])
    return float(np.linalg.norm(apart, axis=-1).max())


def fitting_shapes(betas: Array, model: SmplModel) -> Array:
    """The coefficients; raises InputError where the model has no directions for some."""
    known = model.shape_directions.shape[-1]
    if betas.shape[-1] > known:
        raise InputError(
            f"a body model with {betas.shape[-1]} shape directions",
            f"one with {known}",
            "Give the model file that the estimate was made with.",
        )
    return betas
