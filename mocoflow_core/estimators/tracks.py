"""The people of an estimate, and the one that is reconstructed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mocoflow_core.errors import InputError

Arrays = Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True, eq=False)
class Track:
    """One person: arrays whose rows belong to frames by **position**.

    Frames may have gaps and any order; ``frame_indices`` names the frame of each row. Constants
    are what belongs to the whole track, such as a focal length.
    """

    person: int | None  # None where the tool knows one person only
    frame_indices: NDArray[np.int32]  # (n,)
    arrays: Arrays  # (n, ...) each
    constants: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.frame_indices)

    def bodies(self, name: str) -> NDArray[np.float64]:
        """Vertices (n, V, 3), for any V. Raises InputError as ``floats`` does."""
        given = self.arrays.get(name)
        return self.floats(name, 0 if given is None else given.size // (3 * len(self)), 3)

    def rotations(self, name: str, joints: int) -> NDArray[np.float64]:
        """Axis-angle (n, joints, 3) or matrices (n, joints, 3, 3), as they are stored."""
        given = self.arrays.get(name)
        matrices = given is not None and given.size == len(self) * joints * 9
        return self.floats(name, joints, 3, 3) if matrices else self.floats(name, joints, 3)

    def rows(self, name: str) -> NDArray[np.float64]:
        """Numbers (n, k), for any k. Raises InputError as ``floats`` does."""
        given = self.arrays.get(name)
        return self.floats(name, 1 if given is None else given.size // len(self))

    def floats(self, name: str, *shape: int) -> NDArray[np.float64]:
        """An array as (n, *shape), whatever axes of one or flattening it was stored with.

        Raises InputError where it is missing or has another size.
        """
        given = self.arrays.get(name)
        if given is None:
            raise InputError(
                f"the track must hold {name}",
                f"{', '.join(sorted(self.arrays))}",
                "Write the estimate again with this part, or use another kind.",
            )
        if given.size != len(self) * int(np.prod(shape)):
            expected = " x ".join(map(str, (len(self), *shape)))
            raise InputError(
                f"{name} must have {expected} numbers, a row for each frame",
                f"{given.shape}",
                "Write the estimate again, or check meshes.kind where it is forced.",
            )
        return np.asarray(given, np.float64).reshape(len(self), *shape)


def choose_track(tracks: Sequence[Track], person: int | None) -> tuple[Track, tuple[str, ...]]:
    """The track of a person, or the longest one, and what is to be said of the choice.

    Its rows come in the order of their frames. Raises InputError for a person that the estimate
    does not hold, and for an estimate without any.
    """
    if not tracks:
        raise InputError("an estimate of a person", "nobody in any frame", "Check the estimate.")
    listed = _listed(tracks)
    if person is None:
        chosen = max(tracks, key=len)
    else:
        found = [track for track in tracks if track.person == person]
        if not found:
            raise InputError(
                "meshes.person must be the id of a person in the estimate",
                f"{person}, but it holds {listed}",
                "Choose one of them, or leave it out for the longest.",
            )
        chosen = found[0]
    remarks = chosen.remarks
    if len(tracks) > 1:
        why = "the longest" if person is None else "as chosen"
        remarks = (f"the estimate holds {listed}; person {chosen.person} is taken, {why}", *remarks)
    return in_order(chosen), remarks


def in_order(track: Track) -> Track:
    """The same track with rows ascending in time."""
    order = np.argsort(track.frame_indices, kind="stable")
    arrays = {name: rows[order] for name, rows in track.arrays.items()}
    return Track(track.person, track.frame_indices[order], arrays, track.constants, track.remarks)


def _listed(tracks: Sequence[Track]) -> str:
    if len(tracks) == 1 and tracks[0].person is None:
        return f"one person without an id ({len(tracks[0])} frames)"
    return ", ".join(f"person {track.person} ({len(track)} frames)" for track in tracks)


def frames_of(record: Mapping[str, object], name: str) -> NDArray[np.int32]:
    """The numbers (n,) of the frames that a record's rows belong to.

    Raises InputError where they are no whole numbers from 0.
    """
    given = np.asarray(record.get(name, ()))
    numeric = given.dtype.kind in "iuf" or not given.size
    if not numeric or (given != np.floor(given)).any() or not _in_range(given):
        raise InputError(
            f"{name} must be whole numbers from 0",
            f"{given.ravel()[:3].tolist()}",
            "Write the estimate again.",
        )
    return given.astype(np.int32).ravel()


def _in_range(numbers: NDArray[np.generic]) -> bool:
    highest = np.iinfo(np.int32).max
    return not numbers.size or bool((numbers >= 0).all() and (numbers <= highest).all())  # type: ignore[operator]


def row_arrays(record: Mapping[str, object], count: int, but: str) -> Arrays:
    """The arrays of a tool's record that have a row for each of ``count`` frames.

    ``but`` is the name of the frame numbers themselves. What a tool leaves None is left out.
    """
    return {
        str(name): np.asarray(value)
        for name, value in record.items()
        if name != but and isinstance(value, np.ndarray) and value.ndim and len(value) == count
    }
