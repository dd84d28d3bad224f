"""The command that turns a data set or a bare video into a scene folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.video_options import Clip, Focal, video_settings
from mocoflow_core.errors import InputError


def import_dataset(
    kind: Annotated[str, typer.Argument(help="people-snapshot, zju-mocap, aist, video or auto.")],
    source: Annotated[
        Path, typer.Argument(help="Folder of the data set or of a subject; video file.")
    ],
    out: Annotated[Path, typer.Option(help="New folder for the scene.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="One choice; see docs/datasets."),
    ] = None,
    body_model: Annotated[
        Path | None, typer.Option(help="SMPL model file, or a folder that holds it.")
    ] = None,
    focal: Annotated[float | None, Focal] = None,
    clip: Annotated[str | None, Clip] = None,
    person: Annotated[
        int | None, typer.Option(help="Of a bare video: which person, from 0.")
    ] = None,
) -> None:
    """Make a scene folder of a data set (People-Snapshot, ZJU-MoCap, AIST) or of a bare video."""
    from flows.imported_scene import choices, tell
    from mocoflow_core.datasets.detect import kind_of
    from mocoflow_core.datasets.import_dataset import import_dataset as import_into
    from tasks.terminal_bar import terminal_bar

    known = kind_of(kind, source)
    said = video_settings(focal, clip, person)
    if said and known.name != "video":
        raise InputError(
            "a bare video for --focal, --clip, --person", known.name, "Leave them out."
        )
    configuration = choices(known, (*(settings or ()), *said), body_model)
    with terminal_bar(f"import {source.resolve().name}") as progress:
        imported = import_into(known, source, configuration, out, progress)
    tell(imported)
    typer.echo(f"Scene: {out}")
