"""A data set's folder in place of a scene's: imported at first use, kept in the user's cache."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING

import typer

from flows.user_folders import body_models_folder, cache_folder
from mocoflow_core.errors import InputError
from mocoflow_core.io.content_key import digest_document
from mocoflow_core.io.full_disk import full_disk_is_bad_input

if TYPE_CHECKING:
    from mocoflow_core.configuration import ConfigurationPart
    from mocoflow_core.datasets.import_dataset import ImportedDataset
    from mocoflow_core.datasets.kinds import DatasetKind


@lru_cache(maxsize=64)
def scene_folder(path: Path, without_bodies: bool, body_model: Path | None = None) -> Path:
    """The path itself, or the scene folder of the data set that lies there.

    Args:
        without_bodies: those of the data set are not needed.
        body_model: file or folder; by default the user's folder of them.

    The data set is read by its defaults and imported once for the same files (their names, sizes
    and times), the same configuration and version. Raises InputError as the import does.
    """
    if path.suffix == ".json" or not path.is_dir() or (path / "scene.json").is_file():
        return path
    from mocoflow_core.datasets.detect import detect_kind

    kind = detect_kind(path)
    configuration = _defaults(kind, without_bodies, body_model)
    folder = (
        cache_folder() / "datasets" / f"{path.resolve().name}-{import_key(path, configuration)}"
    )
    if folder.is_dir():
        typer.echo(f"{path} is {kind.name}, imported before: {folder}", err=True)
        return folder
    typer.echo(f"{path} is {kind.name}: imported into {folder}", err=True)
    try:
        with full_disk_is_bad_input(f"The folder {folder.parent}"):
            tell(_import(kind, path, configuration, folder))
    except InputError as error:
        command = f"mocoflow import {kind.name} {path} --set FIELD=VALUE --out DIR"
        action = f"{error.action} Every choice: {command}."
        raise InputError(error.required, error.got, action) from error
    return folder


def tell(imported: ImportedDataset) -> None:
    """Print what was assumed, measured of the train camera, and unusual, on stderr."""
    for remark in imported.remarks:
        typer.echo(f"  {remark}", err=True)
    measured = ", ".join(f"{name} {value:.4g}" for name, value in imported.of_train_camera.items())
    typer.echo(f"  measured: {measured}", err=True)
    for warning in imported.warnings:
        typer.echo(f"  warning: {warning}", err=True)
    if imported.elsewhere:
        typer.echo(f"  {len(imported.elsewhere)} of evaluation cameras: import.json", err=True)


def choices(
    kind: DatasetKind, settings: Sequence[str], body_model: Path | None
) -> ConfigurationPart:
    """A configuration with settings applied, its body models the user's where none are given."""
    from mocoflow_core.datasets.import_dataset import configure

    takes_model = "body_model" in kind.configuration.model_fields
    if body_model is None and takes_model and body_models_folder().is_dir():
        body_model = body_models_folder()
    return configure(kind, settings, body_model)


def _defaults(
    kind: DatasetKind, without_bodies: bool, body_model: Path | None
) -> ConfigurationPart:
    from mocoflow_core.datasets.import_dataset import configure

    if without_bodies and "bodies" in kind.configuration.model_fields:
        return configure(kind, ("bodies=none",), None)
    return choices(kind, (), body_model)


def _import(
    kind: DatasetKind, source: Path, configuration: ConfigurationPart, folder: Path
) -> ImportedDataset:
    """Two processes may import the same at once: the first to be done gives the folder."""
    from mocoflow_core.datasets.import_dataset import import_dataset
    from tasks.terminal_bar import terminal_bar

    folder.parent.mkdir(parents=True, exist_ok=True)
    beside = Path(mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        with terminal_bar(f"import {source.name}") as progress:
            imported = import_dataset(kind, source, configuration, beside / "scene", progress)
        if not folder.is_dir():
            (beside / "scene").rename(folder)
    finally:
        rmtree(beside, ignore_errors=True)
    return imported


def import_key(source: Path, configuration: ConfigurationPart) -> str:
    """What an import depends on: the files of the data set and of body models, and the choices."""
    from mocoflow_core.datasets.import_dataset import ALGORITHM_VERSION

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
