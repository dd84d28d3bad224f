"""A clip in memory: the undistorted frames of one camera at the working size and rate."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.geometry.camera import Camera


@dataclass(frozen=True, eq=False)
class Clip:
    """What one camera saw. Pixels are sRGB-encoded bytes, masks are true on the person.

    ``held_out`` frames are never trained on: they score the train camera.
    ``has_mask`` is false where a frame came without a mask (its mask is all false).
    """

    camera: Camera  # undistorted pinhole at the working size
    fps: float  # of the working rate
    frame_indices: NDArray[np.int32]  # (T,) source numbers
    frames: NDArray[np.uint8]  # (T, H, W, 3)
    masks: NDArray[np.bool_]  # (T, H, W)
    has_mask: NDArray[np.bool_]  # (T,)
    held_out: NDArray[np.bool_]  # (T,)
    background: NDArray[np.uint8]  # (H, W, 3) what is behind the person
    remarks: tuple[str, ...] = ()  # what had to be guessed or was left out, for the user

    @property
    def times(self) -> NDArray[np.float64]:
        """Time of each frame, normalised to [0, 1] over the clip. Source numbers keep gaps."""
        first, last = int(self.frame_indices[0]), int(self.frame_indices[-1])
        return (self.frame_indices - first) / max(last - first, 1)

    def at_rows(self, rows: NDArray[np.bool_]) -> Clip:
        """Only the frames where ``rows`` (T,) is true."""
        if rows.all():
            return self
        names = ("frame_indices", "frames", "masks", "has_mask", "held_out")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    def save(self, folder: Path) -> None:
        """Write ``clip.json`` and one ``.npy`` for each array into an existing folder."""
        for name in ("frame_indices", "frames", "masks", "has_mask", "held_out", "background"):
            np.save(folder / f"{name}.npy", getattr(self, name))
        description = {
            "name": self.camera.name,
            "fps": self.fps,
            "camera": self.camera.to_json(),
            "remarks": self.remarks,
        }
        (folder / "clip.json").write_text(json.dumps(description, indent=1))

    @classmethod
    def load(cls, folder: Path) -> Clip:
        """Read a saved clip; frames and masks stay on disk until they are touched."""
        description = json.loads((folder / "clip.json").read_text())

        def array(name: str, mmap: bool = False) -> NDArray[np.generic]:
            return np.load(
                folder / f"{name}.npy", mmap_mode="r" if mmap else None, allow_pickle=False
            )

        return cls(
            camera=Camera.from_json(description["name"], description["camera"]),
            fps=description["fps"],
            frame_indices=array("frame_indices"),  # type: ignore[arg-type]
            frames=array("frames", mmap=True),  # type: ignore[arg-type]
            masks=array("masks", mmap=True),  # type: ignore[arg-type]
            has_mask=array("has_mask"),  # type: ignore[arg-type]
            held_out=array("held_out"),  # type: ignore[arg-type]
            background=array("background"),  # type: ignore[arg-type]
            remarks=tuple(description.get("remarks", ())),
        )
