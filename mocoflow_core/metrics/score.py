"""The scores of one rendered view against its photograph, under one written protocol."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.errors import InputError
from mocoflow_core.metrics.crop import Crop
from mocoflow_core.metrics.mask_iou import mask_iou
from mocoflow_core.metrics.psnr import psnr
from mocoflow_core.metrics.ssim import SIGMA_PX, WINDOW_PX, ssim

WHITE = 1.0
_SCIKIT_IMAGE = version("scikit-image")


class EvaluationConfig(ConfigurationPart):
    """Which views are scored, and how."""

    crop_reference_px: int = Field(512, ge=1, description="Side of the paper's crop, pixels.")
    crop_reference_height_px: int = Field(
        1080, ge=1, description="Image height of the paper's data, to which its crop belongs."
    )
    crop_box_margin: float = Field(
        1.2, ge=1.0, description="The crop's side is at least this times the largest mask box."
    )
    opacity_threshold: float = Field(
        0.5, gt=0.0, lt=1.0, description="A rendered pixel above this opacity is the person."
    )
    frames_per_camera: int = Field(
        12, ge=1, description="Scored frames of each camera at the end, evenly spread in time."
    )
    least_shown: float = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description="Frames of other cameras are scored where the train camera sees so much of "
        "the surface that faced it in the first frame; 0: all are.",
    )
    curve_views: int = Field(
        8, ge=1, description="Views scored at each point of the error curve, drawn once by seed."
    )
    seed: int = Field(0, ge=0, description="Draws the views of the error curve.")

    @property
    def crop_share(self) -> float:
        """The paper's crop as a share of the image height."""
        return self.crop_reference_px / self.crop_reference_height_px


def protocol(configuration: EvaluationConfig, side: int, notes: Sequence[str] = ()) -> str:
    """What a score of ``score_view`` means, in one line that goes beside every number.

    Args:
        side: of the crop in pixels, from ``crop_side``.
        notes: further facts about the renders, such as a rotation of the whole scene.
    """
    facts = [
        f"crop {side} px around the truth mask's box (the larger of "
        f"{configuration.crop_reference_px}/{configuration.crop_reference_height_px} of the image "
        f"height and {configuration.crop_box_margin:g} x the largest box of the scene)",
        "white outside the truth mask, the render over white",
        f"render's mask: opacity above {configuration.opacity_threshold:g}",
        "PSNR of sRGB values; psnr, ssim over the crop, psnr_union over both masks, "
        "psnr_image over the whole image",
        f"SSIM: Gaussian window {WINDOW_PX} px, sigma {SIGMA_PX}, scikit-image {_SCIKIT_IMAGE}",
        *notes,
    ]
    return "; ".join(facts)


def on_white(
    rgb: NDArray[np.uint8] | NDArray[np.floating], mask: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """A photograph (H, W, 3) as floats in [0, 1] with everything outside the mask painted white.

    Bytes are divided by 255; floats are taken as they are.
    """
    unit = rgb.astype(np.float32) / 255.0 if rgb.dtype == np.uint8 else rgb.astype(np.float32)
    return np.where(mask[..., None], unit, np.float32(WHITE))


def score_view(
    rendered_rgb: NDArray[np.floating],
    rendered_opacity: NDArray[np.floating],
    truth_rgb: NDArray[np.uint8] | NDArray[np.floating],
    truth_mask: NDArray[np.bool_],
    crop: Crop,
    configuration: EvaluationConfig,
) -> dict[str, float]:
    """``psnr``, ``ssim`` over the crop, ``psnr_union``, ``psnr_image`` and ``mask_iou``.

    Args:
        rendered_rgb: (H, W, 3) in [0, 1], already composited over white.
        rendered_opacity: (H, W) in [0, 1].
        truth_rgb: (H, W, 3) the undistorted photograph, bytes or floats in [0, 1].
        truth_mask: (H, W), at least one true pixel.

    Raises:
        InputError: an empty truth mask, a size that disagrees, or a render with NaN in it.

    Source: MoCo-Flow sec. 4 (crop, background masked out).
    """
    if not truth_mask.any():
        raise InputError("a truth mask with a person", "an empty mask", "Do not score this view.")
    if not (np.isfinite(rendered_rgb).all() and np.isfinite(rendered_opacity).all()):
        raise InputError("a finite render", "NaN or infinity", "Look at the run's guard events.")
    truth = on_white(truth_rgb, truth_mask)
    rendered_mask = rendered_opacity > configuration.opacity_threshold
    rendered_crop, truth_crop = crop.of(rendered_rgb, WHITE), crop.of(truth, WHITE)
    return {
        "psnr": psnr(rendered_crop, truth_crop),
        "psnr_union": psnr(rendered_rgb, truth, rendered_mask | truth_mask),
        "psnr_image": psnr(rendered_rgb, truth),
        "ssim": ssim(rendered_crop, truth_crop),
        "mask_iou": mask_iou(rendered_mask, truth_mask),
    }
