"""The runs that a store knows of, and which of its artifacts they need.

A run writes itself down under ``runs/`` of its store when it takes its folder, and adds every
artifact as it uses it. Who collects garbage keeps what the runs need whose folders are still there.
"""

from __future__ import annotations

import hashlib
import socket
from collections.abc import Iterable
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from mocoflow_core.io.run_folder import RUN, RunRecord

RUNS = "runs"  # beside the folders of the stages


class KnownRun(BaseModel):
    """One run: its folder, the machine that the folder is on, the artifacts that it has used."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    folder: str
    host: str
    artifacts: tuple[str, ...] = ()  # as "<stage>/<key>"

    @classmethod
    def here(cls, folder: Path) -> KnownRun:
        return cls(folder=str(folder.resolve()), host=socket.gethostname())

    @classmethod
    def read(cls, content: bytes) -> KnownRun | None:
        try:
            return cls.model_validate_json(content)
        except ValidationError:
            return None

    @property
    def file(self) -> str:
        """Its name in the store: a folder's next run takes the place of its last one."""
        name = hashlib.sha256(f"{self.host}\0{self.folder}".encode()).hexdigest()[:16]
        return f"{RUNS}/{name}.json"

    def content(self) -> bytes:
        return (self.model_dump_json(indent=1) + "\n").encode()

    def with_artifact(self, name: str) -> KnownRun:
        return self.model_copy(update={"artifacts": (*self.artifacts, name)})

    def is_kept(self) -> bool:
        """Whether its folder is still there; nobody here can say that another machine's is not."""
        return (Path(self.folder) / RUN).is_file() or self.host != socket.gethostname()


def runs_below(folders: Iterable[Path]) -> list[KnownRun]:
    """The runs whose folders lie anywhere below the given ones, from what they left there."""
    found = []
    for file in (file for folder in folders for file in sorted(folder.rglob(RUN))):
        try:
            record = RunRecord.model_validate_json(file.read_bytes())
        except (OSError, ValidationError):
            continue
        used = tuple(f"{stage.name}/{stage.key}" for stage in record.stages)
        found.append(KnownRun.here(file.parent).model_copy(update={"artifacts": used}))
    return found
