"""The command that turns a data set into a scene folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def import_dataset(
    kind: Annotated[str, typer.Argument(help="people-snapshot, zju-mocap, aist or auto.")],
    source: Annotated[Path, typer.Argument(help="Folder of the data set, or of one subject.")],
    out: Annotated[Path, typer.Option(help="New folder for the scene.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="One choice; see docs/datasets."),
    ] = None,
    body_model: Annotated[
        Path | None, typer.Option(help="SMPL model file, or a folder that holds it.")
    ] = None,
) -> None:
    """Make a scene folder of a data set: People-Snapshot, ZJU-MoCap or AIST."""
    from flows.imported_scene import choices, tell
    from mocoflow_core.datasets.detect import kind_of
    from mocoflow_core.datasets.import_dataset import import_dataset as import_into
    from tasks.terminal_bar import terminal_bar

    known = kind_of(kind, source)
    configuration = choices(known, settings or (), body_model)
    with terminal_bar(f"import {source.resolve().name}") as progress:
        imported = import_into(known, source, configuration, out, progress)
    tell(imported)
    typer.echo(f"Scene: {out}")
