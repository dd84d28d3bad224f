"""The command line. Heavy imports wait until a command needs them, so that help is instant."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from flows.benchmark_command import benchmark
from flows.bounds import MONTH_S
from flows.finished_run import export, render
from flows.import_dataset import import_dataset
from flows.list_options import ListOptions
from flows.prefect_settings import set_environment, undisturbed
from flows.scene_options import (
    BODY_MODEL_HELP,
    MESHES_HELP,
    PERSON_HELP,
    PRESET_HELP,
    SCENE_HELP,
    Seed,
)
from flows.store_commands import store_app
from flows.video_options import Clip, Focal, is_bare_video, video_settings
from flows.worker_options import SlotsOfServer
from mocoflow_core.errors import InputError

app = typer.Typer(
    help="A moving person, filmed by one fixed camera, seen from any side at any time.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

# A first look: scoring all views takes as long as the reconstruction.
DEMO_SETTINGS = ["evaluation.frames_per_camera=6"]


def main() -> None:
    """Exit codes: 0 done, 2 bad input with a one-line reason, 1 failure."""
    try:
        app()
    except InputError as error:
        typer.echo("mocoflow: " + " ".join(str(error).split()), err=True)
        sys.exit(2)


@app.command()
def reconstruct(
    scene: Annotated[Path, typer.Argument(help=SCENE_HELP)],
    out: Annotated[Path | None, typer.Option(help="New folder for the results.")] = None,
    preset: Annotated[str, typer.Option(help=PRESET_HELP)] = "fast",
    meshes: Annotated[Path | None, typer.Option(help=MESHES_HELP)] = None,
    person: Annotated[int | None, typer.Option(help=PERSON_HELP)] = None,
    body_model: Annotated[Path | None, typer.Option(help=BODY_MODEL_HELP)] = None,
    focal: Annotated[float | None, Focal] = None,
    clip: Annotated[str | None, Clip] = None,
    seed: Annotated[int, Seed] = 0,
    budget: Annotated[
        float | None, typer.Option(help="Seconds of the training clock.", min=1.0, max=MONTH_S)
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(metavar="train_psnr=DB", help="Stop at this score of held-out train pixels."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="One field of the configuration."),
    ] = None,
    store: Annotated[str | None, typer.Option(help="Folder or address of the store.")] = None,
    devices: Annotated[
        int | None,
        typer.Option(help="GPUs, or cores without any, that share the optimisation."),
    ] = None,
    machines: Annotated[int, typer.Option(help="With so many devices each.")] = 1,
    rendezvous: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Where several machines meet.")
    ] = None,
    slots: Annotated[str | None, SlotsOfServer] = None,
) -> None:
    """Reconstruct a scene: train, render, score, report."""
    from flows.request import Request

    out = out or Path(f"{scene.resolve().name}-reconstructed")
    settings = _said(scene, meshes, settings, person, body_model, focal, clip)
    request = Request(
        scene_path=scene,
        preset=preset,
        meshes=meshes,
        seed=seed,
        budget_s=budget,
        until=until,
        settings=tuple(settings),
        store_url=store,
        devices=devices,
        machines=machines,
        rendezvous=rendezvous,
    )
    folder = request.claim(out)
    out = folder.path
    if folder.is_finished():
        typer.echo(f"Already finished: {out / 'report.html'}")
        return
    set_environment()
    from flows.reconstruct import reconstruct as flow

    with undisturbed():
        flow(
            scene=scene,
            out=out,
            preset=preset,
            meshes=meshes,
            seed=seed,
            budget_s=budget,
            until=until,
            settings=request.settings,
            store=store,
            devices=devices,
            machines=machines,
            rendezvous=rendezvous,
            slots=slots or None,
        )
    typer.echo(f"Report: {out / 'report.html'}")


@app.command()
def plan(
    scene: Annotated[Path, typer.Argument(help=SCENE_HELP)],
    preset: Annotated[str, typer.Option(help=PRESET_HELP)] = "fast",
    meshes: Annotated[Path | None, typer.Option(help=MESHES_HELP)] = None,
    person: Annotated[int | None, typer.Option(help=PERSON_HELP)] = None,
    body_model: Annotated[Path | None, typer.Option(help=BODY_MODEL_HELP)] = None,
    focal: Annotated[float | None, Focal] = None,
    clip: Annotated[str | None, Clip] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="One field of the configuration."),
    ] = None,
    store: Annotated[str | None, typer.Option(help="Folder or address of the store.")] = None,
) -> None:
    """Prepare a scene and say what it needs, before the optimisation."""
    from flows.request import Request

    # Bad settings are refused before anything heavy is loaded.
    settings = _said(scene, meshes, settings, person, body_model, focal, clip)
    request = Request(scene_path=scene, preset=preset, meshes=meshes, settings=tuple(settings))
    request.check()
    set_environment()
    from rich.console import Console

    from flows.plan import plan as flow
    from flows.plan_table import print_plan

    with undisturbed():
        planned = flow(
            scene=scene,
            preset=preset,
            meshes=meshes,
            settings=tuple(settings),
            store=store,
        )
    print_plan(planned, Console())


def _said(
    scene: Path,
    meshes: Path | None,
    settings: list[str] | None,
    person: int | None,
    body_model: Path | None,
    focal: float | None,
    clip: str | None,
) -> list[str]:
    """The settings, with those that have options of their own."""
    filmed = is_bare_video(scene) and meshes is None
    own = video_settings(focal, clip, person if filmed else None, "video.")
    if person is not None and not filmed:
        own.append(f"meshes.person={person}")
    if body_model is not None:
        own.append(f"meshes.body_model={json.dumps(str(body_model))}")
    return [*(settings or ()), *own]


app.add_typer(store_app, name="store")
app.command("import")(import_dataset)
app.command(cls=ListOptions)(benchmark)
app.command()(render)
app.command()(export)


@app.command()
def synth(
    name: Annotated[str, typer.Argument(help="turn, walk, dance, spin or still; see the README.")],
    out: Annotated[Path, typer.Option(help="New folder for the scene.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="One field of the scene."),
    ] = None,
) -> None:
    """Make a synthetic scene with exact truth."""
    from mocoflow_core.synthetic.catalogue import named_scene
    from mocoflow_core.synthetic.scene_writer import write_scene
    from tasks.terminal_bar import terminal_bar

    configuration = named_scene(",".join((name, *(settings or ()))))
    with terminal_bar(f"synth {configuration.name}") as progress:
        write_scene(configuration, out, progress)
    typer.echo(f"Scene: {out}")


@app.command(cls=ListOptions)
def stability(
    out: Annotated[Path, typer.Option(help="New folder for table, plots and page.")],
    areas: Annotated[
        list[str] | None,
        typer.Option("--area", metavar="NAME...", help="Only these areas."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Leave out what trains scenes.")] = False,
) -> None:
    """Check stiff and extreme cases against their bounds; exit code 1 when one fails."""
    set_environment()
    from flows.stability import CasesFailed
    from flows.stability import stability as flow
    from mocoflow_core.stability.catalogue import require_areas

    require_areas(areas or ())
    try:
        with undisturbed():
            summary = flow(out=out, areas=tuple(areas or ()), quick_only=quick)
    except CasesFailed as failed:
        typer.echo(f"{failed}\nStability: {out / 'stability.html'}")
        raise typer.Exit(1) from failed
    typer.echo(f"{summary}\nStability: {out / 'stability.html'}")


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="New folder for the results.")] = Path("demo"),
    seed: Annotated[int, Seed] = 0,
) -> None:
    """Reconstruct a synthetic scene, made at first use."""
    from flows.demo_scene import DEMO_SCENE, demo_scene

    reconstruct(scene=demo_scene(DEMO_SCENE), out=out, seed=seed, settings=DEMO_SETTINGS)
