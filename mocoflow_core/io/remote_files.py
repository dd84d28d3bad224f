"""Files behind an fsspec address, below one folder; every question is asked persistently."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import fsspec

from mocoflow_core.io.retry import persistent

Answer = TypeVar("Answer")

# What file systems call the time of the last change.
_TIMES = ("LastModified", "last_modified", "mtime", "updated", "created")


@dataclass(frozen=True)
class RemoteFile:
    size: int
    changed_at: float  # seconds of the epoch, by the other side's clock
    tag: str = ""  # changes with the content, where the store tells one


@dataclass(frozen=True)
class OpenUpload:
    """A file whose parts were sent and never joined: it takes space and is seen nowhere."""

    path: str
    upload: str
    begun_at: float


class RemoteFiles:
    """Paths are relative to the address. All methods raise InputError for a store out of reach."""

    def __init__(self, url: str, filesystem: fsspec.AbstractFileSystem, base: str) -> None:
        self.url = url
        self._filesystem = filesystem
        self._base = base.rstrip("/")

    def below(self, folder: str = "") -> dict[str, RemoteFile]:
        """Every file below a folder."""
        at = self._at(folder)

        def listed() -> Mapping[str, Mapping[str, Any]]:
            self._filesystem.invalidate_cache()
            return self._filesystem.find(at, detail=True)

        try:
            found = self._ask(listed)
        except FileNotFoundError:
            return {}
        return {
            path[len(self._base) + 1 :]: RemoteFile(
                int(facts["size"]), _changed_at(facts), str(facts.get("ETag", ""))
            )
            for path, facts in found.items()
        }

    def read(self, path: str) -> bytes | None:
        """A small file; ``None`` where there is none."""
        try:
            return self._ask(lambda: self._filesystem.cat_file(self._at(path)))
        except FileNotFoundError:
            return None

    def make_folder(self, folder: str) -> None:
        """Where files are to be written; a bucket too."""
        self._ask(lambda: self._filesystem.makedirs(self._at(folder), exist_ok=True))

    def write(self, path: str, content: bytes) -> None:
        """A small file, in one step."""
        self._ask(lambda: self._filesystem.pipe_file(self._at(path), content))

    def send(self, source: Path, path: str) -> None:
        """Upload a file. It is seen under its name when it is whole."""
        self._ask(lambda: self._filesystem.put_file(str(source), self._at(path)))

    def fetch(self, path: str, target: Path) -> None:
        """Download a file. Raises FileNotFoundError where there is none."""
        self._ask(lambda: self._filesystem.get_file(self._at(path), str(target)))

    def digest(self, path: str) -> str:
        """SHA-256 of what the other side holds, read back. Raises FileNotFoundError."""

        def read_back() -> str:
            with self._filesystem.open(self._at(path), "rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()

        return self._ask(read_back)

    def remove(self, paths: Iterable[str]) -> None:
        """Remove files; those that are gone already do no harm."""
        for address in map(self._at, paths):
            with suppress(FileNotFoundError):
                self._ask(partial(self._filesystem.rm_file, address))

    def open_uploads(self) -> list[OpenUpload]:
        """Uploads of several parts that nobody finished, where the store has such (S3)."""
        if "s3" not in self._protocols:
            return []
        bucket, _, folder = self._base.partition("/")
        asked = {"Bucket": bucket, "Prefix": f"{folder}/" if folder else ""}
        found: list[OpenUpload] = []
        while True:
            try:
                page = self._ask(
                    lambda: self._filesystem.call_s3("list_multipart_uploads", **asked)
                )
            except FileNotFoundError:  # What some stores say where no upload is open.
                return found
            for upload in page.get("Uploads", ()):
                path = upload["Key"][len(asked["Prefix"]) :]
                begun_at = upload["Initiated"].timestamp()
                found.append(OpenUpload(path, upload["UploadId"], begun_at))
            if not page.get("IsTruncated"):
                return found
            asked["KeyMarker"] = page["NextKeyMarker"]
            asked["UploadIdMarker"] = page["NextUploadIdMarker"]

    def abort(self, upload: OpenUpload) -> None:
        """Give back the space of an unfinished upload."""
        bucket, _, folder = self._base.partition("/")
        key = f"{folder}/{upload.path}" if folder else upload.path
        with suppress(FileNotFoundError):  # Finished or aborted in the meantime.
            self._ask(lambda: self._filesystem.abort_mpu(bucket, key, upload.upload))

    @property
    def _protocols(self) -> tuple[str, ...]:
        protocol = self._filesystem.protocol
        return (protocol,) if isinstance(protocol, str) else tuple(protocol)

    def _at(self, path: str) -> str:
        return f"{self._base}/{path}".rstrip("/")

    def _ask(self, question: Callable[[], Answer]) -> Answer:
        return persistent(self.url, question)


def _changed_at(facts: Mapping[str, Any]) -> float:
    """As the store tells it; the beginning of time where it does not."""
    told = next((facts[name] for name in _TIMES if facts.get(name) is not None), 0.0)
    return told.timestamp() if isinstance(told, datetime) else float(told)
