"""What a remote store holds: artifacts, and what uploads that were cut off have left."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mocoflow_core.io.holdings import FolderHoldings, Held, Holdings
from mocoflow_core.io.known_runs import RUNS, KnownRun, RunRecords, is_record
from mocoflow_core.io.manifest import MANIFEST, NO_MANIFEST, OTHER_MANIFEST, Manifest, Payload
from mocoflow_core.io.remote_files import OpenUpload, RemoteFile, RemoteFiles
from mocoflow_core.io.remote_store import RemoteStore
from mocoflow_core.io.store import Store

Files = Mapping[str, RemoteFile]  # of one key, by their last names


def holdings_of(store: Store) -> tuple[Holdings, ...]:
    """Where a store has its artifacts: the store, and of a remote one its mirror here as well."""
    local = FolderHoldings(store.root)
    return (RemoteHoldings(store.files), local) if isinstance(store, RemoteStore) else (local,)


class RemoteHoldings:
    """As of a local store. There are no locks: uploads in flight are told by their age alone."""

    least_age_s = 3600.0

    def __init__(self, files: RemoteFiles) -> None:
        self.place = files.url
        self._files = files
        self._records = RunRecords(files.url, files.read)

    def look(self) -> list[Held]:
        keys = _by_key(self._files.below())
        uploads = _uploads_by_key(self._files.open_uploads())
        held: list[Held] = []
        for name in sorted({*keys, *uploads}):
            files = keys.get(name, {})
            manifest = self._manifest(name) if MANIFEST in files else None
            held += [_artifact(name, files, manifest)] if MANIFEST in files else []
            spare = _unnamed(files, manifest)
            if spare or name in uploads:
                held.append(_leftover(name, spare, uploads.get(name, [])))
        return held

    def verify(self, held: Held) -> str | None:
        files = _by_key(self._files.below(held.name)).get(held.name, {})
        manifest = self._manifest(held.name)
        if fault := _fault(held.name, files, manifest):
            return fault
        assert manifest is not None
        for payload in manifest.payloads:
            if self._files.digest(f"{held.name}/{payload.sha256}") != payload.sha256:
                return f"{payload.path} has changed since it was written"
        return None

    def remove(self, held: Held, needed: Callable[[], bool]) -> bool:
        """The manifest goes first: an artifact that is seen stays whole."""
        files = _by_key(self._files.below(held.name)).get(held.name, {})
        manifest = self._manifest(held.name) if MANIFEST in files else None
        going = _unnamed(files, manifest) if held.leftover else files
        if any(file.changed_at > held.used_at for file in going.values()):
            return False
        if not self._hidden_unless(needed, f"{held.name}/{MANIFEST}", MANIFEST in going):
            return False
        # The manifest sorts last: one that somebody has written meanwhile would be seen and broken.
        self._files.remove(f"{held.name}/{name}" for name in sorted(going))
        if held.leftover:
            for upload in _uploads_by_key(self._files.open_uploads()).get(held.name, []):
                if upload.begun_at <= held.used_at:
                    self._files.abort(upload)
        return True

    def runs(self) -> list[KnownRun]:
        files = self._files.below(RUNS)
        return self._records.of({path: file for path, file in files.items() if is_record(path)})

    def forget(self, run: KnownRun) -> None:
        self._files.remove([run.file])

    def _hidden_unless(self, needed: Callable[[], bool], manifest: str, there: bool) -> bool:
        """Remove a manifest, for good unless it is needed; what fails puts it back."""
        content = self._files.read(manifest) if there else None
        if content is None:
            return not needed()
        self._files.remove([manifest])
        stays = True
        try:
            stays = needed()
        finally:
            if stays:
                self._files.write(manifest, content)
        return not stays

    def _manifest(self, name: str) -> Manifest | None:
        return Manifest.parse(self._files.read(f"{name}/{MANIFEST}"))


def _by_key(files: Files) -> dict[str, dict[str, RemoteFile]]:
    """The files of each ``<stage>/<key>``."""
    found: dict[str, dict[str, RemoteFile]] = {}
    for path, file in files.items():
        name, _, last = path.rpartition("/")
        if name.count("/") == 1:
            found.setdefault(name, {})[last] = file
    return found


def _uploads_by_key(uploads: list[OpenUpload]) -> dict[str, list[OpenUpload]]:
    found: dict[str, list[OpenUpload]] = {}
    for upload in uploads:
        found.setdefault(upload.path.rpartition("/")[0], []).append(upload)
    return found


def _artifact(name: str, files: Files, manifest: Manifest | None) -> Held:
    named = _payloads(manifest) if manifest else {}
    return Held(
        name=name,
        size=sum(file.size for last, file in files.items() if last in (MANIFEST, *named)),
        used_at=files[MANIFEST].changed_at,
        wall_s=manifest.wall_s if manifest else None,
        fault=_fault(name, files, manifest),
    )


def _leftover(name: str, spare: Files, uploads: list[OpenUpload]) -> Held:
    times = [f.changed_at for f in spare.values()] + [u.begun_at for u in uploads]
    return Held(
        name=name,
        size=sum(file.size for file in spare.values()),
        used_at=max(times),
        fault="left by an upload that was cut off, or replaced",
        leftover=True,
    )


def _fault(name: str, files: Files, manifest: Manifest | None) -> str | None:
    if manifest is None:
        return NO_MANIFEST
    if not manifest.is_of(*name.split("/")):
        return OTHER_MANIFEST
    for digest, payload in _payloads(manifest).items():
        if digest not in files:
            return f"{payload.path} is missing"
        if (size := files[digest].size) != payload.size:
            return f"{payload.path} has {size} bytes instead of {payload.size}"
    return None


def _unnamed(files: Files, manifest: Manifest | None) -> dict[str, RemoteFile]:
    """The files that no manifest counts on."""
    named = _payloads(manifest) if manifest else {}
    return {last: file for last, file in files.items() if last not in (MANIFEST, *named)}


def _payloads(manifest: Manifest) -> dict[str, Payload]:
    return {payload.sha256: payload for payload in manifest.payloads}
