"""A few masks of a clip, at a small size, and how bodies agree with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.undistort import WorkingView
from mocoflow_core.datasets.dataset_scene import MaskSource
from mocoflow_core.datasets.picture_size import require_size
from mocoflow_core.geometry.camera import Camera

SAMPLED_FRAMES = 9
LONGER_SIDE_PX = 384


@dataclass(frozen=True, eq=False)
class SampledMasks:
    """Masks without lens distortion, as ``camera`` sees them."""

    camera: Camera
    numbers: NDArray[np.int32]  # (N,) source numbers
    masks: NDArray[np.bool_]  # (N, H, W)

    def overlap(self, world: MeshSequence, shift: int = 0) -> float:
        """Mean IoU with the silhouettes of bodies in world metres, ``shift`` frames later.

        Frames without such a body do not count; 0 where there is none.
        """
        bodies = self.numbers + np.int32(shift)
        present = np.isin(bodies, world.frame_indices)
        if not present.any():
            return 0.0
        posed = world.at(bodies[present])
        seen = silhouettes(posed.vertices, posed.faces, self.camera)
        return float(overlap(seen, self.masks[present]).mean())


def sample_masks(
    camera: Camera,
    masks: MaskSource,
    among: NDArray[np.int32],
    count: int = SAMPLED_FRAMES,
) -> SampledMasks:
    """Up to ``count`` masks of the frames ``among``, spread over them.

    Raises InputError for masks of another size than the camera's.
    """
    available = np.intersect1d(masks.indices, among).astype(np.int32)
    rows = np.linspace(0, len(available) - 1, min(count, len(available)))
    numbers = available[rows.round().astype(int)]
    view = WorkingView.of(camera, LONGER_SIDE_PX)
    seen = np.empty((len(numbers), view.camera.height, view.camera.width), bool)
    for row, (number, mask) in enumerate(masks.read(numbers.tolist())):
        require_size(mask.shape[::-1], camera.size, f"mask {number} of {camera.name}")
        seen[row] = view.mask(mask.astype(np.uint8) * np.uint8(255))
    return SampledMasks(view.camera, numbers, seen)
