"""Masks of ZJU-MoCap: person-parsing labels, foreground masks, or both together."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mocoflow_core.datasets.dataset_scene import Mask
from mocoflow_core.datasets.picture_size import require_size
from mocoflow_core.errors import InputError

MaskChoice = Literal["union", "mask", "mask_cihp"]
FOLDERS: dict[MaskChoice, tuple[str, ...]] = {
    "union": ("mask_cihp", "mask"),
    "mask": ("mask",),
    "mask_cihp": ("mask_cihp",),
}


@dataclass(frozen=True, eq=False)
class LabelMasks:
    """Masks in image files by number, person wherever any file of a number is not zero."""

    images: dict[int, tuple[Path, ...]]
    size: tuple[int, int]  # width, height of the frames

    @property
    def indices(self) -> NDArray[np.int32]:
        return np.array(sorted(self.images), np.int32)

    @property
    def files(self) -> list[Path]:
        return [path for number in sorted(self.images) for path in self.images[number]]

    def read(self, wanted: Collection[int]) -> Iterator[tuple[int, Mask]]:
        """Raises InputError for files that cannot be decoded or have another size."""
        for number in sorted(wanted):
            masks = [self._read(path) for path in self.images[number]]
            yield number, np.logical_or.reduce(masks)

    def _read(self, path: Path) -> Mask:
        mask = read_labels(path)
        require_size(mask.shape[::-1], self.size, f"{path.parent.name}/{path.name}")
        return mask


def find_masks(
    folder: Path,
    pictures: Mapping[int, PurePosixPath],
    choice: MaskChoice,
    size: tuple[int, int],
) -> LabelMasks:
    """The masks that mirror the given pictures' paths; numbers without one are missing."""
    found = {}
    for number, picture in pictures.items():
        paths = [folder / where / picture.with_suffix(".png") for where in FOLDERS[choice]]
        if there := tuple(path for path in paths if path.is_file()):
            found[number] = there
    return LabelMasks(found, size)


def read_labels(path: Path) -> Mask:
    """Any non-zero value in any colour channel is the person; palettes count by their index.

    Raises InputError when the file cannot be decoded.
    """
    try:
        with Image.open(path) as image:
            opaque = {"RGBA": "RGB", "LA": "L"}.get(image.mode)
            labels = np.asarray(image.convert(opaque) if opaque else image)
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        name = f"{path.parent.name}/{path.name}"
        raise InputError("a mask that can be decoded", name, "Copy the file again.") from error
    return np.asarray(labels.reshape(*labels.shape[:2], -1).any(axis=-1), bool)
