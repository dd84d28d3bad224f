"""The command that compares methods. Heavy imports wait until it runs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from flows.bounds import MONTH_S
from flows.prefect_settings import set_environment, undisturbed
from flows.scene_options import PRESET_HELP
from flows.worker_options import CellWorkers, DaskAddress, Slots

# Written out: experiments themselves take torch, which takes a second.
EXPERIMENT_HELP = (
    "removal, progressive, misalignment, partial_observation, train_camera or worse_estimate: "
    "scenes, methods and presets of the paper's, where they are not given."
)


def benchmark(
    out: Annotated[Path, typer.Option(help="New folder for the results.")],
    experiment: Annotated[str | None, typer.Option(help=EXPERIMENT_HELP)] = None,
    scenes: Annotated[
        list[str] | None,
        typer.Option(metavar="SCENE...", help="Folders, or synthetic scenes by name; @CAMERA."),
    ] = None,
    methods: Annotated[
        list[str] | None,
        typer.Option(metavar="METHOD...", help="mocoflow, posed_mesh, without_consensus, ..."),
    ] = None,
    presets: Annotated[
        list[str] | None, typer.Option(metavar="PRESET...", help=PRESET_HELP)
    ] = None,
    seeds: Annotated[int, typer.Option(help="How many seeds, from 0.", min=1, max=100)] = 3,
    budget: Annotated[
        float | None,
        typer.Option(help="Seconds of the training clock of each run.", min=1.0, max=MONTH_S),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE...", help="Fields of the configuration."),
    ] = None,
    targets: Annotated[
        list[str] | None,
        typer.Option(metavar="METRIC=VALUE...", help="Scores to be reached, as psnr_union=20."),
    ] = None,
    store: Annotated[str | None, typer.Option(help="Folder or address of the store.")] = None,
    afresh: Annotated[
        bool, typer.Option("--afresh", help="Measure all again, in a store within --out.")
    ] = False,
    workers: Annotated[int, CellWorkers] = 1,
    dask: Annotated[str | None, DaskAddress] = None,
    slots: Annotated[str | None, Slots] = None,
) -> None:
    """Compare methods and presets on several scenes: error against run time."""
    from flows.benchmark_request import BenchmarkRequest

    request = BenchmarkRequest(
        experiment=experiment,
        scenes=tuple(scenes) if scenes else None,
        out=out,
        methods=tuple(methods) if methods else None,
        presets=tuple(presets) if presets else None,
        seeds=seeds,
        budget_s=budget,
        settings=tuple(settings or ()),
        targets=tuple(targets or ()),
        store_url=store,
        afresh=afresh,
        workers=workers,
        dask=dask,
        slots=slots or None,
    )
    request.claim()
    set_environment()
    from flows.benchmark import NothingFinished
    from flows.benchmark import benchmark as flow

    exit_code = 0
    try:
        with undisturbed():
            flow(
                out=request.out,
                experiment=request.experiment,
                scenes=request.scenes,
                methods=request.methods,
                presets=request.presets,
                seeds=request.seeds,
                budget_s=request.budget_s,
                settings=request.settings,
                targets=request.targets,
                store=request.store_url,
                afresh=request.afresh,
                workers=request.workers,
                dask=request.dask,
                slots=request.slots,
            )
    except NothingFinished:
        exit_code = 1
    _tell_of(request.place)
    sys.exit(exit_code)


def _tell_of(place: Path) -> None:
    """What did not finish, what has become worse, and where the page is."""
    from mocoflow_core.methods.benchmark_folder import read_benchmark

    record = read_benchmark(place)
    assert record is not None  # The flow wrote it.
    for cell in record.cells:
        if cell.state != "finished":
            typer.echo(f"{cell.name} {cell.state}: {cell.reason}", err=True)
    for worse in record.regressions:
        typer.echo(f"Worse than usual: {worse['what']}: {worse['why']}", err=True)
    typer.echo(f"Benchmark: {place / 'benchmark.html'}")
