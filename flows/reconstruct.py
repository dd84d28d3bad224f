"""Flow mocoflow: a scene folder goes in, a trained scene with scores and a report comes out."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

from prefect import flow

from flows.demo_scene import DEMO_SCENE
from flows.optimisation import optimise
from flows.parameters import Budget, Devices, Machines, Rendezvous, Seed, Setting, Slots, Until
from flows.plan_table import show_plan
from flows.preparation import prepare
from flows.request import Request
from flows.results_folders import folder_of_this_run
from flows.run_facts import describe_run, records, show_in_prefect
from flows.slots import held_slot, require_slots
from flows.user_folders import this_machine
from mocoflow_core.io.machine import describe_machine
from mocoflow_core.io.run_folder import RunFolder, RunRecord
from mocoflow_core.presets import Preset
from tasks.extract_evaluation import extract_evaluation
from tasks.render_views import render_views
from tasks.score_views import score_views
from tasks.stage import Aside
from tasks.training_clock import spent_on
from tasks.write_report import write_report


@flow(name="mocoflow", validate_parameters=True)
def reconstruct(
    scene: Path = Path(DEMO_SCENE),
    out: Path | None = None,
    preset: Preset = "fast",
    meshes: Path | None = None,
    seed: Seed = 0,
    budget_s: Budget | None = None,
    until: Until | None = None,
    settings: tuple[Setting, ...] = (),
    import_settings: tuple[Setting, ...] = (),
    store: str | None = None,
    devices: Devices | None = None,
    machines: Machines = 1,
    rendezvous: Rendezvous | None = None,
    slots: Slots | None = None,
) -> RunRecord:
    """Reconstruct the person of a scene folder and say how well it went.

    Args:
        scene: folder with a scene.json or of a data set, video file, or a synthetic scene's name.
        out: new or empty folder, or one of the same request, for what the user keeps; by default
            one named after the run.
        preset: complete configuration to start from.
        meshes: body meshes to use instead of the scene's own: an estimator's file or folder.
        seed: of everything random.
        budget_s: seconds of the training clock.
        until: score at which the optimisation stops, such as ``train_psnr=30``.
        settings: single fields, such as ``schedule.fine_steps=200``.
        import_settings: choices of a data set's import, such as ``sequence=NAME``.
        store: folder or fsspec address of the artifact store.
        devices: GPUs, or cores where there are none, that share the optimisation; by default all
            GPUs where there are several, else one process on the CPU.
        machines: that have so many devices each and the store at the same path.
        rendezvous: ``host:port`` at which several machines meet.
        slots: global concurrency limit of the Prefect server, of which the run holds one slot
            while it works.
    """
    start = perf_counter()
    if slots is not None:
        require_slots(slots)
    request = Request(
        scene_path=scene,
        preset=preset,
        meshes=meshes,
        seed=seed,
        budget_s=budget_s,
        until=until,
        settings=settings,
        import_settings=import_settings,
        store_url=store,
        devices=devices,
        machines=machines,
        rendezvous=rendezvous,
    )
    folder = request.claim(out or folder_of_this_run())
    claimed_s = perf_counter() - start
    with held_slot(slots):
        return _work(request, folder, claimed_s)


def _work(request: Request, folder: RunFolder, claimed_s: float) -> RunRecord:
    """All stages, and what the user keeps of them."""
    start, machine = perf_counter() - claimed_s, describe_machine()
    where, chosen = request.store, request.configuration
    where.serve(folder.path, this_machine())

    prepared = prepare(request)
    show_plan(request, prepared.plan)
    clip, plan, bodies = prepared.clip, prepared.plan, prepared.bodies
    trained = optimise(request, prepared, spent_on(prepared.stages, machine))

    least_shown = chosen.evaluation.least_shown
    turned = prepared.given if least_shown > 0 else None
    evaluation = extract_evaluation(
        where, request.others, clip, chosen.capture, least_shown, turned
    )
    views = render_views(
        where, trained, plan, clip, evaluation, bodies, chosen.evaluation, chosen.presentation
    )
    name = request.scene.description.name
    scores = score_views(
        *(where, name, request.seed, views, trained, clip, evaluation, bodies),
        *(chosen.evaluation, chosen.person_scores, chosen.truth),
    )

    stages = (*prepared.stages, trained, evaluation, views, scores)
    facts = describe_run(clip, evaluation, trained, scores, stages, perf_counter() - start)
    known = folder.begun.model_copy(update=facts)
    about = Aside(known.model_dump(mode="json", exclude_defaults=True))
    report = write_report(where, about, clip, evaluation, plan, trained, views, scores)

    rendered = where.folder(views)
    folder.take(where.folder(plan) / "plan.json", "plan.json")
    folder.take(where.folder(scores) / "scores.parquet", "scores.parquet")
    folder.take(where.folder(scores) / "error_curve.parquet", "error_curve.parquet")
    folder.take(where.folder(report) / "report.html", "report.html")
    folder.take(rendered / "turntable.mp4", "turntable.mp4")
    if views.summary["views"]:
        folder.take(rendered / "mocoflow" / "views", "views")
        folder.take(rendered / "mocoflow" / "opacity", "opacity")
    record = folder.finish({**facts, "stages": records((*stages, report))})
    where.served()
    show_in_prefect(record, folder.path / "report.html", where.folder(report) / "error_curve.png")
    return record
