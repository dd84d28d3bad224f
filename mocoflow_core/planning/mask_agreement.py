"""How well the located body explains the masks: the evidence behind most decisions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocoflow_core.body.agreement import outline_distances, outside_distances
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.clip import Clip

PERCENTILE = 95


@dataclass(frozen=True)
class MaskAgreement:
    """Over the frames that may be trained on; nan where no mask shows the person."""

    overlap: float  # mean intersection over union
    outline_px: float  # 95th percentile of the distance from the masks' outline to the body's
    outside_m: float  # 95th percentile of how far mask pixels lie outside the body
    pixel_m: float  # size of a working pixel at the body's distance


def mask_agreement(clip: Clip, meshes: MeshSequence) -> MaskAgreement:
    """Compare silhouettes with masks; ``meshes`` in world metres, at the clip's frames."""
    used = np.flatnonzero(~clip.held_out & clip.has_mask & clip.masks.any(axis=(1, 2)))
    masks, vertices = clip.masks[used], meshes.vertices[used]
    if not len(used):
        nan = float("nan")
        return MaskAgreement(nan, nan, nan, nan)
    bodies = silhouettes(vertices, meshes.faces, clip.camera)
    pairs = list(zip(masks, bodies, strict=True))
    outline = np.concatenate([outline_distances(mask, body) for mask, body in pairs])
    outside = np.concatenate([outside_distances(mask, body) for mask, body in pairs])
    depth_m = float(np.median((vertices.mean(axis=1) @ clip.camera.R.T + clip.camera.t)[:, 2]))
    pixel_m = depth_m / float(np.sqrt(clip.camera.K[0, 0] * clip.camera.K[1, 1]))
    return MaskAgreement(
        float(overlap(bodies, masks).mean()),
        float(np.percentile(outline, PERCENTILE)) if len(outline) else float("nan"),
        float(np.percentile(outside, PERCENTILE)) * pixel_m if len(outside) else 0.0,
        pixel_m,
    )
