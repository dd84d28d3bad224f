"""Repair a body estimate before any training: bend its joints until it fits masks and colours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field
from torch import Tensor

from mocoflow_core.body.articulation import Articulation, articulate
from mocoflow_core.body.colour_misfit import ColourMisfit, ColourMisfitConfig
from mocoflow_core.body.joint_correction import JointCorrection, smooth_mixing
from mocoflow_core.body.mask_misfit import MaskMisfit, MaskMisfitConfig, between
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.clip import Clip
from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.progress import Progress
from mocoflow_core.threads import torch_threads

# Gradients of whitened unknowns are of size one or more where they say anything; smaller ones are
# not blown up to full steps.
_ADAM_EPSILON = 1.0


class RoundsConfig(ConfigurationPart):
    """How long is searched. From the first round to the last, what is far off counts less."""

    rounds: int = Field(ge=0, description="Looks at the body as it stands by then.")
    steps: int = Field(ge=1, description="Optimiser steps after each look.")
    rate: float = Field(gt=0, description="Adam's first rate, in usual errors; falls to 0.")
    outlier_m: tuple[float, float] = Field(
        description="Outlines farther off count less: in the first round, in the last."
    )


class RepairConfig(ConfigurationPart):
    """What is usual of body estimators, and how long to search."""

    parts: int = Field(32, ge=1, description="Rigid parts looked for in the mesh's motion.")
    blend_m: float = Field(0.04, gt=0, description="Motion is blended so far across a joint.")
    joint_error_deg: float = Field(4.0, gt=0, description="Usual error about each axis of a joint.")
    stiff_error_deg: float = Field(0.3, gt=0, description="The same where the mesh never bends.")
    root_error_m: float = Field(0.02, gt=0, description="Usual error of the body's place.")
    searched_error_m: float = Field(
        0.12, gt=0, description="The same, instead of it, where the place was searched."
    )
    size_error: float = Field(
        0.05, ge=0, description="Usual error of the body's size, as a share; 0: it is right."
    )
    searched_size_error: float = Field(
        0.0, ge=0, description="The same, instead of it, where the place was searched."
    )
    least_size_error: float = Field(
        0.03,
        ge=0,
        description="Smaller ones are taken for errors of depth before colours are fitted.",
    )
    # With 0.5 a dance keeps nearly twice the error, a slow turn a tenth less: estimate_repair.md.
    error_seconds: float = Field(0.35, gt=0, description="How long an error stays alike.")
    clothes_m: float = Field(0.02, gt=0, description="Usual standing off of clothes from the mesh.")
    masks: MaskMisfitConfig = MaskMisfitConfig()
    colours: ColourMisfitConfig = ColourMisfitConfig()
    by_masks: RoundsConfig = RoundsConfig(rounds=12, steps=12, rate=0.15, outlier_m=(0.08, 0.02))
    by_both: RoundsConfig = RoundsConfig(rounds=6, steps=20, rate=0.1, outlier_m=(0.02, 0.02))

    def after_search(self) -> RepairConfig:
        """Where the place was found from the masks and the size the body came with.

        Such a place errs by more, and says nothing of the size.
        """
        errors = {"root_error_m": self.searched_error_m, "size_error": self.searched_size_error}
        return self.model_copy(update=errors)


def outlines_apart(clip: Clip, meshes: MeshSequence, configuration: RepairConfig) -> float:
    """How far the body's outline is from the masks', in pixels; nan where no mask shows it.

    What clothes can explain, part by part, is taken off: see ``MaskMisfit.apart_px``. Looks at the
    training frames alone.
    """
    looked_at, rows = _training_frames(clip, meshes)
    masks = MaskMisfit(clip, looked_at, rows, meshes.faces, configuration.masks)
    vertices = meshes.vertices[rows]
    whole_px = masks.apart_px(vertices, np.zeros(vertices.shape[1], np.int64))
    if not whole_px > configuration.masks.agreeing_px:
        return whole_px
    skeleton = articulate(meshes.vertices, meshes.faces, configuration.parts, configuration.blend_m)
    return masks.apart_px(vertices, skeleton.weights.argmax(1))


def repair_body(
    clip: Clip,
    meshes: MeshSequence,
    expected: float,
    configuration: RepairConfig,
    progress: Progress,
) -> MeshSequence:
    """The meshes with their joints and place corrected towards what the training frames show.

    The correction is the likeliest one: each joint errs by a few degrees, smoothly in time, the
    whole body is too large or too small by a few percent, clothes stand off by a distance of each
    part's own. First the outlines are laid onto the masks, and a size that is found wrong by next
    to nothing is taken for right; then the colour of each point of the skin must stay the same as
    well. Held-out frames, which are not looked at, and frames between get the correction of the
    moment. Where no error is expected, or no mask shows anybody, the meshes come back as they were.

    Args:
        clip: of the camera trained on.
        meshes: world metres; holds every frame of the clip.
        expected: size of the errors, in usual ones.
    """
    looked_at, rows = _training_frames(clip, meshes)
    if not len(looked_at) or expected == 0:
        return meshes
    masks = MaskMisfit(clip, looked_at, rows, meshes.faces, configuration.masks)
    skeleton = articulate(meshes.vertices, meshes.faces, configuration.parts, configuration.blend_m)
    colours = ColourMisfit(clip, looked_at, rows, meshes, skeleton.weights, configuration.colours)
    frames = clip.frame_indices[looked_at]
    correction = _no_correction(skeleton, meshes, clip, frames, expected, configuration)
    # Sums over several threads differ in their last bit from run to run.
    with torch_threads(1):
        _fit_masks(correction, masks, configuration.by_masks, progress)
        if configuration.colours.independent_points and configuration.by_both.rounds:
            correction.doubt_size(configuration.least_size_error)
            _fit_both(correction, masks, colours, configuration.by_both, progress)
        with torch.no_grad():
            vertices = correction.vertices(np.arange(len(meshes.vertices)))
    return replace(meshes, vertices=vertices)


def _training_frames(
    clip: Clip, meshes: MeshSequence
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of the clip, and of the meshes, of the training frames with a person in the mask."""
    shown = ~clip.held_out & clip.has_mask & clip.masks.any(axis=(1, 2))
    looked_at = np.flatnonzero(shown)
    return looked_at, np.searchsorted(meshes.frame_indices, clip.frame_indices[looked_at])


def _no_correction(
    skeleton: Articulation,
    meshes: MeshSequence,
    clip: Clip,
    frames: NDArray[np.int32],
    expected: float,
    configuration: RepairConfig,
) -> JointCorrection:
    kept = clip.frame_indices[~clip.held_out]
    stride = float(np.median(np.diff(kept))) if len(kept) > 1 else 1.0
    rate = stride * clip.fps  # of the source's numbering
    mixing = smooth_mixing(meshes.frame_indices / rate, frames / rate, configuration.error_seconds)
    least, most = np.radians([configuration.stiff_error_deg, configuration.joint_error_deg])
    angles = np.clip(skeleton.bend, least, most)
    angles[0] = most
    return JointCorrection(
        skeleton,
        meshes.vertices,
        mixing,
        expected * angles,
        expected * configuration.root_error_m,
        expected * configuration.size_error,
        configuration.clothes_m,
    )


def _fit_masks(
    correction: JointCorrection, masks: MaskMisfit, search: RoundsConfig, progress: Progress
) -> None:
    def look(share: float) -> Callable[[], Tensor]:
        targets = masks.look(correction)
        outlier_m = between(search.outlier_m, share)
        return lambda: masks(correction, targets, outlier_m)

    _search(correction, look, search, lambda share: progress(0.6 * share, "fitting the masks"))


def _fit_both(
    correction: JointCorrection,
    masks: MaskMisfit,
    colours: ColourMisfit,
    search: RoundsConfig,
    progress: Progress,
) -> None:
    generator = torch.Generator().manual_seed(0)

    def look(share: float) -> Callable[[], Tensor]:
        targets = masks.look(correction)
        sights = colours.look(correction, share)
        outlier_m = between(search.outlier_m, share)
        return lambda: (
            masks(correction, targets, outlier_m) + colours(correction, sights, generator)
        )

    def told(share: float) -> None:
        progress(0.6 + 0.4 * share, "fitting the colours")

    _search(correction, look, search, told)


def _search(
    correction: JointCorrection,
    look: Callable[[float], Callable[[], Tensor]],
    search: RoundsConfig,
    told: Callable[[float], None],
) -> None:
    """Minimise surprise and misfit; ``look`` gives the misfit as the body stands by then."""
    optimiser = torch.optim.Adam(correction.unknowns(), search.rate, eps=_ADAM_EPSILON)
    total = max(search.rounds * search.steps, 1)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimiser, lambda step: 0.5 * (1.0 + np.cos(np.pi * step / total))
    )
    for number in range(search.rounds):
        told(number / search.rounds)
        misfit = look(number / max(search.rounds - 1, 1))
        for _ in range(search.steps):
            optimiser.zero_grad()
            loss = correction.surprise() + misfit()
            loss.backward()
            optimiser.step()
            schedule.step()
