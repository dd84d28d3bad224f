"""Structural similarity of Wang et al. 2004 with their Gaussian window."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

# Wang et al. 2004, section III.B: an 11 x 11 window with a standard deviation of 1.5 pixels, and
# the constants K1, K2. They are the definition of the score, so no field changes them.
WINDOW_PX = 11
SIGMA_PX = 1.5
K1 = 0.01
K2 = 0.03


def ssim(image: NDArray[np.floating], reference: NDArray[np.floating]) -> float:
    """Mean structural similarity, at most 1, over pixels and the three colour channels.

    Population covariances over the Gaussian window, as in the original paper; the border
    of half a window is left out, as scikit-image does.

    Args:
        image, reference: (H, W, 3) sRGB-encoded in [0, 1], H and W at least ``WINDOW_PX``.
    """
    return float(
        structural_similarity(
            image.astype(np.float64),
            reference.astype(np.float64),
            channel_axis=-1,
            data_range=1.0,
            gaussian_weights=True,
            sigma=SIGMA_PX,
            win_size=WINDOW_PX,
            use_sample_covariance=False,
            K1=K1,
            K2=K2,
        )
    )
