"""Where an error at unseen views rises late in a run: wrong colours, or sharp ones out of place?

    python -m benchmarks.blurred_curves [--scenes NAME ...] [--blurs PX ...]

One run of the default preset for each scene, seed 0, one thread. Every snapshot is rendered at
eight views of other cameras and compared as it is and after a Gaussian blur. PSNR punishes sharp
detail that lies beside its place twice: where it is, and where it is missing. If a curve turns as
it is and falls to the end behind a blur of a pixel, the state got no worse, only sharper.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import torch

from benchmarks.falling_curves import KINDS, MEASURED, record
from benchmarks.scene_study import PreparedScene
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.methods.rendered_views import Image, Renderer
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.presets import fast
from mocoflow_core.settings import with_settings


class Blurred:
    """A renderer's pictures, their colours blurred."""

    def __init__(self, renderer: Renderer, blur_px: float) -> None:
        """Args: blur_px standard deviation of the Gaussian; 0: as they are."""
        self._renderer, self._blur_px = renderer, blur_px

    def render(self, camera: Camera, frame_index: int) -> tuple[Image, Image]:
        rgb, opacity = self._renderer.render(camera, frame_index)
        if self._blur_px:
            rgb = cv2.GaussianBlur(rgb, (0, 0), self._blur_px).astype(np.float32)
        return rgb, opacity


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", nargs="+", choices=KINDS, default=["dance_noise6"])
    parser.add_argument("--blurs", nargs="+", type=float, default=[0.0, 0.5, 1.0, 2.0])
    arguments = parser.parse_args()
    configuration = with_settings(fast(), MEASURED)
    torch.set_num_threads(1)
    blurs = "".join(f"| PSNR behind {blur:g} px, dB " for blur in arguments.blurs)
    print(f"| scene | steps {blurs}| SSIM | IoU |")
    print("|-|" + "-:|" * (len(arguments.blurs) + 3))
    glasses = [partial(Blurred, blur_px=blur) for blur in arguments.blurs]
    for name in arguments.scenes:
        with TemporaryDirectory() as folder:
            prepared = PreparedScene(record(name, Path(folder) / "scene"), configuration)
            _print(name, prepared.curves(configuration, 0, "", glasses))


def _print(name: str, curves: list[list[CurveRow]]) -> None:
    """One line for each snapshot."""
    tables = [_by_step(curve) for curve in curves]
    for step, sharp in tables[0].items():
        shown = "".join(f"| {table[step]['psnr_union']:.2f} " for table in tables)
        print(f"| {name} | {step} {shown}| {sharp['ssim']:.3f} | {sharp['mask_iou']:.3f} |")


def _by_step(curve: list[CurveRow]) -> dict[int, dict[str, float]]:
    table: dict[int, dict[str, float]] = {}
    for row in curve:
        table.setdefault(row.step, {})[row.metric] = row.value
    return table


if __name__ == "__main__":
    main()
