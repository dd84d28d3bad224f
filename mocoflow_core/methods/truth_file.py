"""A scene's truth: what the user's ``truth.npz`` holds, for metrics alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError
from mocoflow_core.io.untrusted import read_npz

# Axes, None where any length will do; the first one of all but the faces goes with the frames.
_SHAPES: dict[str, tuple[int | None, ...]] = {
    "frame_indices": (None,),
    "vertices": (None, None, 3),
    "faces": (None, 3),
    "keypoints3d": (None, 17, 3),
}


def read_truth(path: Path) -> dict[str, NDArray[np.generic]]:
    """``frame_indices`` (T,), and ``vertices`` (T, V, 3) with ``faces`` (F, 3) and ``keypoints3d``
    (T, 17, 3) where they are known: world metres, nan where unknown.

    Raises:
        InputError: no such archive of plain arrays, or arrays that do not belong together.
    """
    content = read_npz(path)
    truth = {name: _array(path, name, content[name]) for name in _SHAPES if name in content}
    if "frame_indices" not in truth:
        raise _wrong(path, "no frame_indices")
    lengths = {len(array) for name, array in truth.items() if name != "faces"}
    if len(lengths) > 1:
        raise _wrong(path, f"arrays of {' and '.join(map(str, sorted(lengths)))} frames")
    if "faces" in truth and not _name_vertices(truth):
        raise _wrong(path, "faces without their vertices")
    return truth


def _array(path: Path, name: str, array: object) -> NDArray[np.generic]:
    kinds = "iu" if name in ("frame_indices", "faces") else "fiu"
    if not isinstance(array, np.ndarray) or array.dtype.kind not in kinds:
        raise _wrong(path, f"{name} of another type")
    wanted = _SHAPES[name]
    if array.ndim != len(wanted) or any(
        n not in (None, given) for n, given in zip(wanted, array.shape, strict=True)
    ):
        raise _wrong(path, f"{name} {array.shape}")
    return array


def _name_vertices(truth: dict[str, NDArray[np.generic]]) -> bool:
    faces = truth["faces"].astype(np.int64)
    count = truth["vertices"].shape[1] if "vertices" in truth else 0
    return not faces.size or bool(faces.min() >= 0 and faces.max() < count)


def _wrong(path: Path, found: str) -> InputError:
    return InputError(
        f"{path.name} must hold frame_indices (T,), and vertices (T, V, 3) with faces (F, 3) or "
        "keypoints3d (T, 17, 3)",
        found,
        "Write the truth again with numpy.savez, or leave it out of scene.json.",
    )
