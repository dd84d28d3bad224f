"""A store behind any fsspec address (``s3://...``), worked on through a local mirror.

There, ``<stage>/<key>/`` holds ``manifest.json`` and every payload under its own digest. The
manifest is written last and in one step: it is the commit. As no payload ever replaces another
one, an artifact that is seen is whole, whoever else uploads the same key at the same time.
"""

from __future__ import annotations

import os
from pathlib import Path

from fsspec import AbstractFileSystem
from fsspec.core import url_to_fs

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_document
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.io.known_runs import RUNS, KnownRun
from mocoflow_core.io.manifest import MANIFEST, Manifest, Payload
from mocoflow_core.io.remote_files import RemoteFiles
from mocoflow_core.io.store import Kind, Store, clear_folder

# A payload that arrives damaged so often is damaged there.
SENDINGS = 3


def open_store(url: str, mirrors: Path) -> Store:
    """The store at a folder or fsspec address; remote stores are mirrored below ``mirrors``."""
    filesystem, base = file_system(url)
    if "file" in filesystem.protocol:
        return Store(Path(base))
    files = RemoteFiles(url, filesystem, base)
    return RemoteStore(files, mirrors / digest_document(url)[:16])


def file_system(url: str) -> tuple[AbstractFileSystem, str]:
    """What fsspec opens at an address, and the folder there. Raises InputError where nothing is."""
    try:
        return url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise InputError(
            "The store needs a folder or an address that fsspec can open",
            f"{url!r} ({error})",
            "Correct --store or MOCOFLOW_STORE, or install the file system's package.",
        ) from error


class RemoteStore(Store):
    """Artifacts on an object store; stages and their checkpoints stay in the mirror until done.

    Two machines that want one key at once both compute it. Either upload is whole before it is
    seen, and the one that ends last stays. All methods raise InputError for a store out of reach.
    """

    def __init__(self, files: RemoteFiles, mirror: Path) -> None:
        super().__init__(mirror)
        self.url = files.url
        self.files = files

    def find(self, kind: type[Kind], key: str) -> Kind | None:
        """As for a local store; what only one side holds is copied to the other."""
        if found := self._look_and_share(kind, key):
            return found
        place = self._folder(kind.stage, key)
        with (
            full_disk_is_bad_input(f"The mirror {self.root} of {self.url}"),
            self._locked(place, wait=False) as free,
        ):
            return self._find_locked(kind, key) if free else None

    def _find_locked(self, kind: type[Kind], key: str) -> Kind | None:
        found = self._look_and_share(kind, key)
        if found is None and self._download(kind.stage, key):
            found = self._look(kind, key)
        return found

    def _look_and_share(self, kind: type[Kind], key: str) -> Kind | None:
        found = self._look(kind, key)
        if found:
            self._share(kind.stage, key)
        return found

    def publish(self, partial: Path, manifest: Manifest) -> None:
        super().publish(partial, manifest)
        self._upload(manifest)

    def write_run(self, run: KnownRun) -> None:
        self.files.make_folder(RUNS)
        self.files.write(run.file, run.content())

    def _read(self, name: str) -> bytes | None:
        return self.files.read(name)

    def _share(self, stage: str, key: str) -> None:
        """Upload what the other side lacks: an earlier upload may have been cut off."""
        held = Manifest.parse(self.files.read(address(stage, key, MANIFEST)))
        if held is None or not self._has_all(held):
            manifest = Manifest.read(self._folder(stage, key))
            if manifest is not None:
                self._upload(manifest)

    def _has_all(self, manifest: Manifest) -> bool:
        there = self.files.below(f"{manifest.stage}/{manifest.key}")
        return all(
            (file := there.get(address(manifest.stage, manifest.key, payload.sha256))) is not None
            and file.size == payload.size
            for payload in manifest.payloads
        )

    def _upload(self, manifest: Manifest) -> None:
        """Every payload, read back and compared; then the manifest."""
        folder = self._folder(manifest.stage, manifest.key)
        self.files.make_folder(f"{manifest.stage}/{manifest.key}")
        for payload in {payload.sha256: payload for payload in manifest.payloads}.values():
            self._send(folder / payload.path, payload, manifest)
        content = (folder / MANIFEST).read_bytes()
        self.files.write(address(manifest.stage, manifest.key, MANIFEST), content)

    def _send(self, source: Path, payload: Payload, manifest: Manifest) -> None:
        to = address(manifest.stage, manifest.key, payload.sha256)
        for _ in range(SENDINGS):
            self.files.send(source, to)
            if self.files.digest(to) == payload.sha256:
                return
        raise InputError(
            f"{self.url} must give back what was uploaded",
            f"other bytes of {payload.path}, {SENDINGS} times",
            "Check the network and the store; the artifact is kept on this machine, and the same "
            "command uploads it again.",
        )

    def _download(self, stage: str, key: str) -> bool:
        """Fetch an artifact beside its place and move it there; the caller verifies it."""
        manifest = Manifest.parse(self.files.read(address(stage, key, MANIFEST)))
        if manifest is None or not manifest.is_of(stage, key):
            return False
        folder = self._folder(stage, key)
        arriving = folder.with_name(f"{key}.arriving-{os.getpid()}")
        clear_folder(arriving)
        arriving.mkdir(parents=True)
        try:
            for payload in manifest.payloads:
                target = arriving / payload.path
                target.parent.mkdir(parents=True, exist_ok=True)
                self.files.fetch(address(stage, key, payload.sha256), target)
        except FileNotFoundError:
            clear_folder(arriving)
            return False
        manifest.write(arriving)
        clear_folder(folder)
        arriving.rename(folder)
        return True


def address(stage: str, key: str, name: str) -> str:
    """Where a manifest, or a payload of that digest, lies in a remote store."""
    return f"{stage}/{key}/{name}"
