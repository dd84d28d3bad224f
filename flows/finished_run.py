"""Commands about a finished run: views and meshes of its trained scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mocoflow_core.errors import InputError

if TYPE_CHECKING:
    from mocoflow_core.io.run_folder import RunRecord


def render(
    run: Annotated[Path, typer.Argument(help="Folder of a finished run.")],
    out: Annotated[Path, typer.Option(help="An .mp4, one .png, or a folder of pictures.")],
    camera: Annotated[str, typer.Option(help="Name of a camera of the run, or orbit.")] = "orbit",
    frames: Annotated[str, typer.Option(help="Source numbers: 0,5,10-20.")] = "",
    times: Annotated[str, typer.Option(help="Seconds from the first frame: 0.1,0.25.")] = "",
    fps: Annotated[
        float | None,
        typer.Option(
            help="Pictures per second of the whole clip; beside --frames or --times, of the video.",
            min=0.1,
        ),
    ] = None,
    background: Annotated[str, typer.Option(help="A colour or a picture.")] = "white",
    rotate: Annotated[
        str, typer.Option(help="Turns the person: X,Y,Z, world axis times radians.")
    ] = "",
    size: Annotated[int | None, typer.Option(help="Longer side in pixels.", min=16)] = None,
) -> None:
    """Render views of a finished run; the same command gives the same pictures."""
    from flows.written_lists import read_numbers, read_ranges, read_vector
    from mocoflow_core.methods.novel_views import ViewRequest, render_novel_views
    from tasks.terminal_bar import terminal_bar

    request = ViewRequest(
        camera=camera,
        frames=read_ranges(frames),
        times_s=read_numbers(times),
        fps=fps,
        background=background,
        rotate=read_vector(rotate),
        longer_side_px=size,
    )
    record, trained = _trained_scene(run)
    with terminal_bar("render") as progress:
        count = render_novel_views(record, trained, request, out, progress)
    typer.echo(f"{count} views: {out}")


def export(
    run: Annotated[Path, typer.Argument(help="Folder of a finished run.")],
    out: Annotated[Path, typer.Option(help="A new .glb, or a new folder of .ply files.")],
    format: Annotated[str, typer.Option(help="glb: one animation; ply: one per frame.")] = "glb",
    frames: Annotated[str, typer.Option(help="Source numbers: 0,5,10-20.")] = "",
    spacing_m: Annotated[
        float, typer.Option(help="Of the lattice that the surface is found on.", min=0.001)
    ] = 0.01,
) -> None:
    """Export coloured meshes of a finished run: the canonical surface, and its poses."""
    from flows.written_lists import read_ranges
    from mocoflow_core.methods.mesh_export import MeshRequest, export_meshes
    from tasks.terminal_bar import terminal_bar

    request = MeshRequest(format=format, frames=read_ranges(frames), spacing_m=spacing_m)
    record, trained = _trained_scene(run)
    with terminal_bar("export") as progress:
        mesh = export_meshes(record, trained, request, out, progress)
    size = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} triangles"
    typer.echo(f"{size}, {mesh.floating} small floating parts left out: {out}")


def _trained_scene(run: Path) -> tuple[RunRecord, Path]:
    """The record of a finished run and the folder of its trained scene, or InputError."""
    from flows.users_store import open_users_store
    from mocoflow_core.artifacts import SceneArtifact
    from mocoflow_core.io.run_folder import read_run

    record = read_run(run)
    store = open_users_store(record.store)
    trained = store.find(SceneArtifact, record.stage(SceneArtifact.stage).key)
    if trained is None:
        raise InputError(
            f"The trained scene of {run} must be in {record.store}",
            "nothing intact there",
            "Run `mocoflow reconstruct` again with the same folder.",
        )
    return record, store.folder(trained)
