"""A data set in memory: what every reader makes of its files, before anything is written."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.frame_source import FrameSource
from mocoflow_core.capture.scene_description import BehindPerson, Coordinates
from mocoflow_core.geometry.camera import Camera

Up = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Mask = NDArray[np.bool_]  # (H, W), true on the person


class MaskSource(Protocol):
    """Masks by the source number of their frames."""

    @property
    def indices(self) -> NDArray[np.int32]:
        """(N,) source numbers that have a mask, ascending."""

    @property
    def files(self) -> list[Path]:
        """The files that hold them."""

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        """The wanted masks one at a time, ascending, at the size of the frames."""


@dataclass(frozen=True, eq=False)
class DatasetCamera:
    """A camera with its recording as filmed. The chosen frames only, by the source's numbers."""

    camera: Camera  # of the pictures as stored, distortion included; K with the corner origin
    frames: FrameSource
    masks: MaskSource | None
    background: NDArray[np.uint8] | None = None  # (H, W, 3) sRGB, as distorted as the frames


@dataclass(frozen=True, eq=False)
class DatasetMeshes:
    """The body estimate that comes with a data set."""

    sequence: MeshSequence  # metres
    coordinates: Coordinates  # "camera" is the train camera's
    located: bool  # the translation can be trusted
    source: str  # what made it, in words


@dataclass(frozen=True, eq=False)
class DatasetTruth:
    """What metrics alone may read. World metres; NaN where unknown."""

    frame_indices: NDArray[np.int32]  # (T,) source numbers
    vertices: NDArray[np.float32] | None = None  # (T, V, 3)
    faces: NDArray[np.int32] | None = None  # (F, 3)
    keypoints3d: NDArray[np.float32] | None = None  # (T, 17, 3) COCO order


@dataclass(frozen=True, eq=False)
class DatasetScene:
    """One recording of a data set, in the project's conventions.

    The train camera has every frame from its first to its last, as held-out frames lie between
    those that are learned from; ``working_fps`` thins them out. Other cameras may have gaps.
    ``remarks`` say everything that was assumed, chosen, skipped or missing, in words; ``caveats``
    what scores must be read with.
    """

    name: str
    fps: float  # of the source
    up: Up
    train_camera: str
    cameras: dict[str, DatasetCamera]
    meshes: DatasetMeshes | None
    truth: DatasetTruth | None
    license: str
    attribution: str
    remarks: tuple[str, ...] = ()
    caveats: tuple[str, ...] = ()
    behind_person: BehindPerson = "kept"  # by default; the frames are as filmed
    source_begins_at: int = 0  # the first number of the recording that the clip was cut out of
    working_fps: float | None = None  # to learn from; by default the paper's 12
