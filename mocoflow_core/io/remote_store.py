"""A store behind any fsspec address (``s3://...``), worked on through a local mirror."""

from __future__ import annotations

import os
from pathlib import Path

import fsspec
from fsspec.core import url_to_fs

from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_document
from mocoflow_core.io.manifest import MANIFEST, Manifest
from mocoflow_core.io.store import Kind, Store, clear_folder


def open_store(url: str, mirrors: Path) -> Store:
    """The store at a folder or fsspec address; remote stores are mirrored below ``mirrors``."""
    try:
        filesystem, base = url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise InputError(
            "The store needs a folder or an address that fsspec can open",
            f"{url!r} ({error})",
            "Correct --store, or install the file system's package.",
        ) from error
    if "file" in filesystem.protocol:
        return Store(Path(base))
    return RemoteStore(url, filesystem, base, mirrors / digest_document(url)[:16])


class RemoteStore(Store):
    """Artifacts on an object store, where the manifest is written last: it is the commit.

    Stages and their checkpoints stay in the local mirror until they are finished. Two machines
    that want one key at once both compute it, and both upload the same content.
    """

    def __init__(
        self, url: str, filesystem: fsspec.AbstractFileSystem, base: str, mirror: Path
    ) -> None:
        super().__init__(mirror)
        self.url = url
        self._remote = filesystem
        self._base = base.rstrip("/")

    def find(self, kind: type[Kind], key: str) -> Kind | None:
        """As for a local store; what only one side holds is copied to the other."""
        mirrored = super().find(kind, key)
        if mirrored is None:
            self._download(kind.stage, key)
            return super().find(kind, key)
        self._upload(kind.stage, key)
        return mirrored

    def publish(self, partial: Path, manifest: Manifest) -> None:
        super().publish(partial, manifest)
        self._upload(manifest.stage, manifest.key)

    def _address(self, stage: str, key: str, path: str) -> str:
        return f"{self._base}/{stage}/{key}/{path}"

    def _upload(self, stage: str, key: str) -> None:
        folder = self._folder(stage, key)
        manifest = Manifest.read(folder)
        if manifest is None or self._is_complete(manifest):
            return
        for path in [*(payload.path for payload in manifest.payloads), MANIFEST]:
            address = self._address(stage, key, path)
            self._remote.makedirs(address.rpartition("/")[0], exist_ok=True)
            self._remote.put_file(str(folder / path), address)

    def _is_complete(self, manifest: Manifest) -> bool:
        """Whether the manifest and every payload lie there with their sizes."""
        sizes = {payload.path: payload.size for payload in manifest.payloads}
        addresses = {
            path: self._address(manifest.stage, manifest.key, path) for path in [MANIFEST, *sizes]
        }
        return all(self._remote.exists(address) for address in addresses.values()) and all(
            self._remote.size(addresses[path]) == size for path, size in sizes.items()
        )

    def _download(self, stage: str, key: str) -> None:
        """Fetch an artifact beside its place and move it there; the caller verifies it."""
        folder = self._folder(stage, key)
        arriving = folder.with_name(f"{key}.arriving-{os.getpid()}")
        clear_folder(arriving)
        arriving.mkdir(parents=True)
        try:
            self._fetch(stage, key, arriving, MANIFEST)
            manifest = Manifest.read(arriving)
            for payload in manifest.payloads if manifest else ():
                self._fetch(stage, key, arriving, payload.path)
        except FileNotFoundError:
            clear_folder(arriving)
            return
        clear_folder(folder)
        arriving.rename(folder)

    def _fetch(self, stage: str, key: str, arriving: Path, path: str) -> None:
        target = arriving / path
        target.parent.mkdir(parents=True, exist_ok=True)
        self._remote.get_file(self._address(stage, key, path), str(target))
