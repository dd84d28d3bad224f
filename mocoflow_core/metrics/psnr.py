"""Peak signal-to-noise ratio of colours in [0, 1]."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError


def psnr(
    image: NDArray[np.floating],
    reference: NDArray[np.floating],
    region: NDArray[np.bool_] | None = None,
) -> float:
    """``-10 log10(mean squared error)`` in dB, over the true pixels of ``region`` if given.

    Args:
        image, reference: (H, W, 3) sRGB-encoded in [0, 1].
        region: (H, W), at least one true pixel.

    Returns:
        Decibels; infinite for equal images.

    Raises:
        InputError: sizes that disagree, or an empty region.
    """
    if image.shape != reference.shape:
        raise InputError(
            f"an image of the reference's shape {reference.shape}",
            str(image.shape),
            "Render at the size of the reference.",
        )
    squared_error = (image.astype(np.float64) - reference.astype(np.float64)) ** 2
    if region is not None:
        if not region.any():
            raise InputError("a region with pixels", "an empty one", "Leave this view out.")
        squared_error = squared_error[region]
    mean = float(squared_error.mean())
    return float(np.inf) if mean == 0.0 else -10.0 * float(np.log10(mean))
