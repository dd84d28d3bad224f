"""What a store holds: artifacts, and what killed tries have left beside them."""

from __future__ import annotations

import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from mocoflow_core.io.content_key import KEY_LENGTH
from mocoflow_core.io.known_runs import RUNS, KnownRun, RunRecords, is_record
from mocoflow_core.io.locks import holding, is_held
from mocoflow_core.io.manifest import MANIFEST, Manifest, fault_of
from mocoflow_core.io.store import lock_of


@dataclass(frozen=True)
class Held:
    """An artifact, or what is left over of tries to make it.

    Attributes:
        name: ``<stage>/<key>``.
        size: bytes of all its files.
        used_at: when it was made, or last found in a local store; seconds of the epoch.
        wall_s: seconds that it has cost; ``None`` where no manifest tells.
        fault: what is wrong with it, in words; of a leftover, what it is.
        leftover: whether it is no artifact but leftovers.
        busy: whether a process is computing it right now.
    """

    name: str
    size: int
    used_at: float
    wall_s: float | None = None
    fault: str | None = None
    leftover: bool = False
    busy: bool = False


class Holdings(Protocol):
    """A place with artifacts that can be looked through and tidied up."""

    place: str
    least_age_s: float  # what is younger may be in the making, and never goes

    def look(self) -> list[Held]:
        """Everything there; of artifacts names and sizes are checked, not digests."""
        ...

    def verify(self, held: Held) -> str | None:
        """What the digests of an artifact's files show to be wrong, in words."""
        ...

    def remove(self, held: Held, needed: Callable[[], bool]) -> bool:
        """Remove it; ``False`` where it is used or needed by now, and stays.

        ``needed`` is asked when the artifact is out of sight: whoever uses one writes that down
        before looking for it, so that it is put back for them, or not yet seen.
        """
        ...

    def runs(self) -> list[KnownRun]:
        """The runs that have written themselves down here.

        Raises InputError for a record that cannot be read.
        """
        ...

    def forget(self, run: KnownRun) -> None:
        """Strike a run off."""
        ...


class FolderHoldings:
    """Those of a local store, or of the mirror of a remote one."""

    least_age_s = 0.0  # Locks tell what is in the making.

    def __init__(self, root: Path) -> None:
        self.place = str(root)
        self._root = root
        self._records = RunRecords(self.place, self._read)

    def look(self) -> list[Held]:
        held: list[Held] = []
        for stage in sorted(path for path in self._root.glob("*") if path.is_dir()):
            for key in sorted({name.name[:KEY_LENGTH] for name in _keyed(stage)}):
                folder = stage / key
                held += [self._artifact(folder)] if folder.is_dir() else []
                held += [self._leftover(folder)] if _beside(folder) else []
        return held

    def verify(self, held: Held) -> str | None:
        return fault_of(self._root / held.name)

    def remove(self, held: Held, needed: Callable[[], bool]) -> bool:
        folder = self._root / held.name
        with holding(lock_of(folder), wait=False) as free:
            if not free:
                return False
            if held.leftover:
                if needed():
                    return False
                for path in _beside(folder):
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
            elif folder.is_dir():
                if _used_at(folder) > held.used_at:
                    return False
                if not _clear_unless(needed, folder):
                    return False
            if not folder.is_dir() and not _beside(folder):
                lock_of(folder).unlink()
        return True

    def runs(self) -> list[KnownRun]:
        files = {}
        for file in (file for file in (self._root / RUNS).glob("*") if is_record(file.name)):
            with suppress(FileNotFoundError):  # Struck off by somebody else.
                status = file.stat()
                files[f"{RUNS}/{file.name}"] = status.st_mtime_ns, status.st_size, status.st_ino
        return self._records.of(files)

    def forget(self, run: KnownRun) -> None:
        (self._root / run.file).unlink(missing_ok=True)

    def _read(self, name: str) -> bytes | None:
        with suppress(FileNotFoundError):
            return (self._root / name).read_bytes()
        return None

    def _artifact(self, folder: Path) -> Held:
        manifest = Manifest.read(folder)
        return Held(
            name=f"{folder.parent.name}/{folder.name}",
            size=_measure([folder])[0],
            used_at=_used_at(folder),
            wall_s=manifest.wall_s if manifest else None,
            fault=fault_of(folder, thorough=False),
        )

    def _leftover(self, folder: Path) -> Held:
        size, changed_at = _measure(_beside(folder))
        busy = is_held(lock_of(folder))
        return Held(
            name=f"{folder.parent.name}/{folder.name}",
            size=size,
            used_at=changed_at,
            fault="being computed" if busy else "left by a try that was killed",
            leftover=True,
            busy=busy,
        )


def _used_at(folder: Path) -> float:
    """Finding an artifact touches its manifest."""
    return _measure([folder / MANIFEST if Manifest.read(folder) else folder])[1]


def _clear_unless(needed: Callable[[], bool], folder: Path) -> bool:
    """Take a folder away, for good unless it is needed; what fails puts it back."""
    rubbish = folder.with_name(f"{folder.name}.rubbish")
    shutil.rmtree(rubbish, ignore_errors=True)
    folder.rename(rubbish)
    stays = True
    try:
        stays = needed()
    finally:
        if stays:
            rubbish.rename(folder)
    if not stays:
        shutil.rmtree(rubbish)
    return not stays


def _keyed(stage: Path) -> Iterator[Path]:
    """Files and folders of a stage whose names begin with a key."""
    return (path for path in stage.iterdir() if _is_key(path.name[:KEY_LENGTH]))


def _is_key(name: str) -> bool:
    return len(name) == KEY_LENGTH and set(name) <= set("0123456789abcdef")


def _beside(folder: Path) -> list[Path]:
    """Workspaces, clocks and half downloads of an artifact: all that bears its key but the lock."""
    return [path for path in folder.parent.glob(f"{folder.name}.*") if path != lock_of(folder)]


def _measure(paths: list[Path]) -> tuple[int, float]:
    """Bytes of all files below, and when the last of them was changed."""
    size, changed_at = 0, 0.0
    for file in (file for path in paths for file in (path, *path.rglob("*"))):
        with suppress(FileNotFoundError):  # A process is at work here.
            status = file.stat()
            size += status.st_size if stat.S_ISREG(status.st_mode) else 0
            changed_at = max(changed_at, status.st_mtime)
    return size, changed_at
