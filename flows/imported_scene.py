"""A data set or a bare video in place of a scene: imported at first use, kept in the cache."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from flows.allowed_folders import AllowedFolders
from flows.user_folders import body_models_folder, cache_folder
from flows.video_options import is_bare_video
from mocoflow_core.errors import InputError

if TYPE_CHECKING:
    from mocoflow_core.configuration import ConfigurationPart
    from mocoflow_core.datasets.import_dataset import ImportedDataset
    from mocoflow_core.datasets.kinds import DatasetKind
    from mocoflow_core.video.configuration import VideoConfig


_LEAVE = "Leave it out."


@lru_cache(maxsize=64)
def scene_folder(
    path: Path,
    without_bodies: bool,
    body_model: Path | None = None,
    video: VideoConfig | None = None,
    import_settings: tuple[str, ...] = (),
) -> Path:
    """The path itself, or the scene folder of the data set or the video that lies there.

    Args:
        without_bodies: those of the data set are not needed.
        body_model: file or folder; by default the user's folder of them.
        video: what was said of a bare video; nothing may be said of anything else.
        import_settings: single choices of the data set's import; for nothing else.

    A data set is read by its defaults otherwise and imported once for the same files (their
    names, sizes and times), the same configuration and version. Raises InputError as the import
    does, and for files outside of the allowed folders.
    """
    filmed = is_bare_video(path)
    if video and not filmed:
        raise InputError("a bare video, of which something is said", f"{path}", _LEAVE)
    if not filmed and (not path.is_dir() or (path / "scene.json").is_file()):
        if import_settings:
            raise InputError("a data set, of whose import something is said", f"{path}", _LEAVE)
        return path
    from mocoflow_core.datasets.detect import kind_of
    from mocoflow_core.datasets.import_cache import import_once, place_of_import
    from tasks.progress import showing_progress

    kind = kind_of("auto", path)
    said = video or (choices(kind, import_settings, body_model) if import_settings else None)
    configuration = _without_bodies(kind, said, without_bodies) or choices(kind, (), body_model)
    AllowedFolders.of_environment().check_files(configuration)
    folder = place_of_import(path, configuration, cache_folder() / "datasets")
    if folder.is_dir():
        typer.echo(f"{path} is {kind.name}, imported before: {folder}", err=True)
        return folder
    typer.echo(f"{path} is {kind.name}: imported into {folder}", err=True)
    try:
        with showing_progress("import") as progress:
            imported = import_once(kind, path, configuration, folder, progress)
        tell(imported)
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


def _without_bodies(
    kind: DatasetKind, said: ConfigurationPart | None, without_bodies: bool
) -> ConfigurationPart | None:
    """What was said, or the defaults, without bodies; None where nothing is to be changed."""
    if without_bodies and "bodies" in kind.configuration.model_fields:
        return (said or kind.configuration()).model_copy(update={"bodies": "none"})
    return said
