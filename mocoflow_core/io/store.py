"""The artifact store: a folder of finished stages, named by the key of their content.

``<store>/<stage>/<key>/`` appears by one rename, when its manifest and payloads are on the disk.
Until then the stage works in ``<key>.partial/``, which outlives a killed process, so that a long
stage resumes there from its checkpoints.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import JsonValue

from mocoflow_core.artifacts import Artifact
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.io.known_runs import KnownRun, UseLog
from mocoflow_core.io.locks import holding
from mocoflow_core.io.manifest import (
    MANIFEST,
    Manifest,
    describe_payloads,
    fault_of,
    flush_to_disk,
    library_versions,
)
from mocoflow_core.io.whole_file import whole_file
from mocoflow_core.io.work_clock import WorkClock

Kind = TypeVar("Kind", bound=Artifact)


class Store:
    """Artifacts in a local folder."""

    def __init__(self, folder: Path) -> None:
        self.root = folder
        self.url = str(folder)
        self._uses: UseLog | None = None

    def serve(self, folder: Path, machine: str) -> None:
        """From now on note what the run in this folder uses: it is kept as long as the folder.

        ``machine`` tells the one that the folder is on from others. Raises ``InputError`` on a full
        disk.
        """
        run = KnownRun.here(folder, machine)
        self._uses = UseLog(run, KnownRun.read(self._read(run.file)), self.write_run)

    def served(self) -> None:
        """The run is finished."""
        if self._uses:
            self._uses.close()

    def find(self, kind: type[Kind], key: str) -> Kind | None:
        """The finished artifact; ``None`` where it is absent, incomplete or damaged.

        Sizes and digests of all payloads are checked (digests once for an untouched file).
        """
        return self._look(kind, key)

    def fault(self, kind: type[Kind], key: str) -> str | None:
        """What is wrong with an artifact that is there and yet not found, in words."""
        folder = self._folder(kind.stage, key)
        return fault_of(folder) if folder.exists() else None

    def folder(self, artifact: Artifact) -> Path:
        """The local folder with the payloads of an artifact that was found or just committed."""
        return self._folder(artifact.stage, artifact.key)

    @contextmanager
    def computing(self, kind: type[Kind], key: str, *, resumes: bool) -> Iterator[Workspace[Kind]]:
        """The sole right to compute one artifact; another process that wants it waits here.

        The lock belongs to the process: the kernel drops it when the process dies. With
        ``resumes`` the workspace of a killed try is kept. Raises ``InputError`` on a full disk.
        """
        folder = self._folder(kind.stage, key)
        partial = folder.with_name(f"{key}.partial")
        with full_disk_is_bad_input(f"The artifact store {self.root}"), self._locked(folder):
            found = self._find_locked(kind, key)
            if found is None:
                clear_folder(folder)
                if not resumes:
                    self._forget_try(partial)
                partial.mkdir(parents=True, exist_ok=True)
            yield Workspace(self, kind, key, partial, found)

    def publish(self, partial: Path, manifest: Manifest) -> None:
        """Make a finished workspace the artifact, in one step."""
        manifest.write(partial)
        flush_to_disk(partial)
        folder = self._folder(manifest.stage, manifest.key)
        partial.rename(folder)
        _sync_folder(folder.parent)

    def write_run(self, run: KnownRun) -> None:
        """Write down what a run has used so far. Raises ``InputError`` on a full disk."""
        file = self.root / run.file
        with full_disk_is_bad_input(f"The artifact store {self.root}"):
            file.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(file) as beside:
                beside.write_bytes(run.content())

    def _read(self, name: str) -> bytes | None:
        """A small file of the store; ``None`` where there is none."""
        file = self.root / name
        return file.read_bytes() if file.exists() else None

    def _look(self, kind: type[Kind], key: str) -> Kind | None:
        """The finished artifact in the local folder; being looked at makes it young again.

        That it is used is written down first, whether it is there or not: a killed try is needed
        as well, and who removes artifacts puts those back that somebody has asked for meanwhile.
        """
        self._note_use(kind.stage, key)
        folder = self._folder(kind.stage, key)
        with suppress(OSError):  # Absent, or a store that may only be read.
            os.utime(folder / MANIFEST)
        manifest = Manifest.read(folder)
        if manifest is None or fault_of(folder):
            return None
        return reference_to(kind, manifest, cached=True)

    def _find_locked(self, kind: type[Kind], key: str) -> Kind | None:
        """As ``find``, for who holds the artifact's lock."""
        return self._look(kind, key)

    def _note_use(self, stage: str, key: str) -> None:
        if self._uses:
            self._uses.note(f"{stage}/{key}")

    @staticmethod
    def _locked(folder: Path, *, wait: bool = True) -> AbstractContextManager[bool]:
        return holding(lock_of(folder), wait=wait)

    def _forget_try(self, partial: Path) -> None:
        clear_folder(partial)
        WorkClock.of(partial).forget()

    def _folder(self, stage: str, key: str) -> Path:
        return self.root / stage / key


class Workspace(Generic[Kind]):
    """Where one stage writes its payloads; ``found`` holds the artifact if another made it."""

    def __init__(
        self, store: Store, kind: type[Kind], key: str, path: Path, found: Kind | None
    ) -> None:
        self.path = path
        self.found = found
        self._store = store
        self._kind = kind
        self._key = key
        self._clock = WorkClock.of(path)

    def note_time(self) -> None:
        """Write down the seconds worked so far, so that a kill does not forget them."""
        self._clock.note()

    def leave_out(self, wall_s: float, cpu_s: float) -> None:
        """Take off seconds that were no work on the artifact."""
        self._clock.leave_out(wall_s, cpu_s)

    def commit(
        self,
        algorithm_version: int,
        inputs: Mapping[str, str],
        configuration: Mapping[str, JsonValue],
        summary: Mapping[str, JsonValue],
    ) -> Kind:
        """Turn the workspace into the artifact."""
        manifest = Manifest(
            stage=self._kind.stage,
            key=self._key,
            algorithm_version=algorithm_version,
            inputs=dict(inputs),
            configuration=dict(configuration),
            payloads=describe_payloads(self.path),
            wall_s=self._clock.wall_s,
            cpu_s=self._clock.cpu_s,
            versions=library_versions(),
            summary=dict(summary),
        )
        self._store.publish(self.path, manifest)
        self._clock.forget()
        return reference_to(self._kind, manifest, cached=False)


def reference_to(kind: type[Kind], manifest: Manifest, *, cached: bool) -> Kind:
    """The small reference that stages pass on instead of the manifest."""
    return kind(
        key=manifest.key,
        wall_s=manifest.wall_s,
        cpu_s=manifest.cpu_s,
        cached=cached,
        summary=manifest.summary,
    )


def lock_of(folder: Path) -> Path:
    """The file whose lock is the sole right to make, or remove, an artifact's folder."""
    return folder.with_name(f"{folder.name}.lock")


def clear_folder(folder: Path) -> None:
    """Remove a folder; renamed first, so that a kill leaves no half of it under its name."""
    if folder.exists():
        rubbish = folder.with_name(f"{folder.name}.rubbish")
        shutil.rmtree(rubbish, ignore_errors=True)
        folder.rename(rubbish)
        shutil.rmtree(rubbish)


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
