"""Imports that are kept: the same files, choices and version give the same scene folder."""

from __future__ import annotations

from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

from mocoflow_core.configuration import ConfigurationPart
from mocoflow_core.datasets.import_dataset import (
    ALGORITHM_VERSION,
    ImportedDataset,
    Progress,
    import_dataset,
)
from mocoflow_core.datasets.kinds import DatasetKind
from mocoflow_core.io.content_key import digest_document
from mocoflow_core.io.full_disk import full_disk_is_bad_input


def place_of_import(source: Path, configuration: ConfigurationPart, cache: Path) -> Path:
    """The scene folder of an import, whether it is there yet or not."""
    return cache / f"{source.resolve().name}-{import_key(source, configuration)}"


def import_once(
    kind: DatasetKind,
    source: Path,
    configuration: ConfigurationPart,
    folder: Path,
    progress: Progress | None = None,
) -> ImportedDataset:
    """Import into a folder of the cache.

    Two processes may import the same at once: the first to be done gives the folder.

    Raises InputError as ``import_dataset`` does.
    """
    with full_disk_is_bad_input(f"The folder {folder.parent}"):
        folder.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
        try:
            imported = import_dataset(kind, source, configuration, beside / "scene", progress)
            if not folder.is_dir():
                (beside / "scene").rename(folder)
        finally:
            rmtree(beside, ignore_errors=True)
    return imported


def import_key(source: Path, configuration: ConfigurationPart) -> str:
    """What an import depends on: the files of the data set and of body models, and the choices."""
    given = getattr(configuration, "body_model", None)
    document = {
        "version": ALGORITHM_VERSION,
        "configuration": configuration.model_dump(mode="json"),
        "files": _stamps(source),
        "body_models": _stamps(given) if given else [],
    }
    return digest_document(document)[:12]


def _stamps(folder: Path) -> list[list[object]]:
    """Name, size and time of every file: gigabytes of pictures are not read for their digest."""
    stamps: list[list[object]] = []
    for file in sorted(folder.rglob("*")) if folder.is_dir() else [folder]:
        if file.is_file():
            status = file.stat()
            stamps.append(
                [str(file.relative_to(folder.parent)), status.st_size, status.st_mtime_ns]
            )
    return stamps
