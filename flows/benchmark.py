"""Flow benchmark: scenes x presets x methods x seeds, each a flow run, into one comparison."""

from __future__ import annotations

from pathlib import Path

from prefect import flow

from flows.benchmark_request import BenchmarkRequest
from flows.misplaced_scenes import misplaced_scenes
from flows.parameters import (
    Budget,
    ExperimentName,
    Method,
    Processes,
    Scheduler,
    Seeds,
    Setting,
    Slots,
    Target,
)
from flows.regression_event import tell_of_regressions
from flows.results_folders import folder_of_this_run
from flows.run_cells import run_cells
from flows.run_facts import show_benchmark_in_prefect
from mocoflow_core.methods.benchmark_folder import RECORD, BenchmarkRecord
from mocoflow_core.methods.past_benchmarks import past_nights
from mocoflow_core.presets import Preset
from tasks.collect_cells import collect_cells
from tasks.source import folder_source
from tasks.write_benchmark import write_benchmark

TABLES = ("scores.parquet", "error_curve.parquet")
COLLECTED = (*TABLES, "time_to_target.parquet", "misalignment.parquet")


class NothingFinished(RuntimeError):
    """There is nothing to compare; the page says why each run did not finish."""


@flow(name="benchmark", validate_parameters=True)
def benchmark(
    out: Path | None = None,
    scenes: tuple[str, ...] | None = None,
    methods: tuple[Method, ...] | None = None,
    presets: tuple[Preset, ...] | None = None,
    experiment: ExperimentName | None = None,
    seeds: Seeds = 3,
    budget_s: Budget | None = None,
    settings: tuple[Setting, ...] = (),
    targets: tuple[Target, ...] = (),
    store: str | None = None,
    afresh: bool = False,
    workers: Processes = 1,
    dask: Scheduler | None = None,
    slots: Slots | None = None,
) -> BenchmarkRecord:
    """Compare methods and presets on several scenes, each cell a flow run of its own.

    Cells run one after the other, in several processes or on a Dask cluster, with the same results.
    One that fails, that is cancelled on Prefect's pages, or whose
    settings make no sense, is an omission of the comparison and stops no other; one that is
    finished in its folder is not run again.

    Args:
        out: new or empty folder, or one of a benchmark with the same settings and budget; by
            default one named after the run.
        scenes: folders, or synthetic scenes by name, with settings as in ``turn,seed=1``, or
            ``aist``, ``zju-mocap``, ``people-snapshot``: all of the data set that lies on the
            worker; with ``@CAMERA`` behind it that camera is learned from.
        methods: mocoflow, its ablations, steps of the paper's series, and posed_mesh, which is
            scored within their runs. By default mocoflow and posed_mesh.
        presets: complete configurations to start from, by default fast.
        experiment: one of the paper's, which says scenes, methods and presets where nothing else
            does.
        seeds: how many; 3 are the seeds 0, 1 and 2.
        budget_s: seconds of the training clock of each cell.
        settings: single fields for all cells, such as ``schedule.fine_steps=200``.
        targets: scores to be reached, such as ``psnr_union=20``.
        store: folder or fsspec address of the artifact store.
        afresh: measure everything again, in a store within ``out``, instead of taking what earlier
            runs have made; what a comparison over nights needs.
        workers: processes of this machine that run cells at once, each with its share of the cores.
        dask: address of a Dask scheduler whose workers run the cells; they read and write the same
            paths as this process.
        slots: what each running cell holds one of: a resource of the Dask workers, else a global
            concurrency limit of the Prefect server.

    Raises:
        InputError: what no cell could run with.
        NothingFinished: after everything is written.
    """
    request = BenchmarkRequest(
        experiment=experiment,
        scenes=scenes,
        out=out or folder_of_this_run(),
        methods=methods,
        presets=presets,
        seeds=seeds,
        budget_s=budget_s,
        settings=settings,
        targets=targets,
        store_url=store,
        afresh=afresh,
        workers=workers,
        dask=dask,
        slots=slots,
    )
    folder, where = request.claim(), request.store
    cells = run_cells(request.cells(), request.runs_on)
    misplaced, unread = misplaced_scenes(request)

    done = [cell for cell in cells if cell.state == "finished"]
    files = folder_source(
        folder.path, [f"{cell.folder}/{table}" for cell in done for table in TABLES]
    )
    records = [cell.model_dump(mode="json") for cell in cells]
    tables = collect_cells(
        where, files, records, list(request.methods), request.waited_for, misplaced
    )
    nights = past_nights(folder.path, folder.begun)
    around = folder.path.resolve().parent
    page = write_benchmark(
        *(where, tables, records, request.command, request.experiment),
        *([omission._asdict() for omission in unread], nights),
        folder_source(around, [f"{night}/{RECORD}" for night in nights]),
    )

    for name in COLLECTED:
        folder.take(where.folder(tables) / name, name)
    for name in ("benchmark.html", "table.md", "history.parquet"):
        folder.take(where.folder(page) / name, name)
    chart = where.folder(page) / "error_against_time.png"
    if done:
        folder.take(chart, chart.name)
    found = {name: tuple(values) for name, values in page.summary.items()}
    record = folder.finish({"cells": cells, **found})
    show_benchmark_in_prefect(record, folder.path / "benchmark.html", chart)
    tell_of_regressions(record, folder.path / "benchmark.html")
    if (cells and not done) or (unread and not misplaced):
        count = len(cells) + len(unread)
        raise NothingFinished(f"none of {count} runs finished: {folder.path}/benchmark.html")
    return record
