"""Flow benchmark: scenes x presets x methods x seeds, each a flow run, into one comparison."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from prefect import State, flow

from flows.benchmark_request import BenchmarkRequest, Cell
from flows.reconstruct import reconstruct
from flows.run_facts import show_benchmark_in_prefect
from mocoflow_core.errors import InputError
from mocoflow_core.io.run_folder import RunRecord, read_run
from mocoflow_core.methods.benchmark_folder import BenchmarkRecord, CellRecord
from tasks.collect_cells import collect_cells
from tasks.misplace_views import misplace_views
from tasks.source import folder_source
from tasks.terminal_bar import terminal_line
from tasks.write_benchmark import write_benchmark

TABLES = ("scores.parquet", "error_curve.parquet")
COLLECTED = (*TABLES, "time_to_target.parquet", "misalignment.parquet")


@flow(name="benchmark", validate_parameters=True)
def benchmark(
    out: Path,
    scenes: tuple[str, ...] | None = None,
    methods: tuple[str, ...] | None = None,
    presets: tuple[str, ...] | None = None,
    experiment: str | None = None,
    seeds: int = 3,
    budget_s: float | None = None,
    settings: tuple[str, ...] = (),
    targets: tuple[str, ...] = (),
    store: str | None = None,
) -> BenchmarkRecord:
    """Compare methods and presets on several scenes, each cell a flow run of its own.

    Cells run one after the other. One that fails, or whose settings make no sense, is an omission
    of the comparison and stops no other; one that is finished in its folder is not run again.

    Args:
        out: new or empty folder, or one of a benchmark with the same settings and budget.
        scenes: folders, or synthetic scenes by name, with settings as in ``turn,seed=1``; with
            ``@CAMERA`` behind it that camera is learned from.
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
    """
    request = BenchmarkRequest(
        experiment=experiment,
        scenes=scenes,
        out=out,
        methods=methods,
        presets=presets,
        seeds=seeds,
        budget_s=budget_s,
        settings=settings,
        targets=targets,
        store_url=store,
    )
    folder, where = request.claim(), request.store
    cells = tuple(run_cell(cell) for cell in request.cells())

    done = [cell for cell in cells if cell.state == "finished"]
    files = folder_source(out, [f"{cell.folder}/{table}" for cell in done for table in TABLES])
    records = [cell.model_dump(mode="json") for cell in cells]
    tables = collect_cells(
        where, files, records, list(request.methods), request.waited_for, misplaced_rows(request)
    )
    page = write_benchmark(where, tables, records, request.command, request.experiment)

    for name in COLLECTED:
        folder.take(where.folder(tables) / name, name)
    for name in ("benchmark.html", "table.md"):
        folder.take(where.folder(page) / name, name)
    chart = where.folder(page) / "error_against_time.png"
    if done:
        folder.take(chart, chart.name)
    found = {name: tuple(values) for name, values in page.summary.items()}
    record = folder.finish({"cells": cells, **found})
    show_benchmark_in_prefect(record, out / "benchmark.html", chart)
    return record


def misplaced_rows(request: BenchmarkRequest) -> list[dict[str, Any]]:
    """What scores make of misplaced views of each scene, where the experiment asks for it."""
    measured = [
        misplace_views(
            *(request.store, shown.recording, shown.others, name),
            *(shown.configuration.capture, shown.configuration.evaluation),
        )
        for name, shown in request.shifted_scenes()
    ]
    return [row for artifact in measured for row in artifact.summary["rows"]]


def run_cell(cell: Cell) -> CellRecord:
    """Run one cell as a flow run that carries its name, unless its folder is finished."""
    record, request, out = cell
    if record.state == "refused":
        return record
    terminal_line(record.name)
    if not _is_finished(cell):
        named = reconstruct.with_options(flow_run_name=lambda: record.name)
        state = named(
            scene=request.scene_path,
            out=out,
            preset=request.preset,
            seed=request.seed,
            budget_s=request.budget_s,
            settings=request.settings,
            store=request.store_url,
            return_state=True,
        )
        if not state.is_completed():
            ended = "cancelled" if state.is_cancelled() else "failed"
            return record.model_copy(update={"state": ended, "reason": _reason(state)})
    return record.finished_as(read_run(out), out)


def _reason(state: State[RunRecord]) -> str:
    """Why it ended, on one line; bad input speaks for itself, other errors say what they are."""
    error = state.result(raise_on_failure=False)
    if isinstance(error, InputError):
        reason = str(error)
    elif isinstance(error, BaseException):
        reason = f"{type(error).__name__}: {error}"
    else:
        reason = state.message or str(state.name)
    return " ".join(reason.split())


def _is_finished(cell: Cell) -> bool:
    try:
        return cell.request.claim(cell.out).is_finished()
    except InputError:
        return False  # Its own flow run will say why.
