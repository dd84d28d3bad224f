"""Commands about the artifact store: what it holds, whether that is whole, what can go."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flows.list_options import ListOptions

if TYPE_CHECKING:
    from mocoflow_core.io.garbage import Sentence
    from mocoflow_core.io.holdings import Held, Holdings
    from mocoflow_core.io.known_runs import KnownRun

DAY_S = 86400.0

store_app = typer.Typer(
    help="Look through the artifact store, check it, tidy it up.", no_args_is_help=True
)

Address = Annotated[str | None, typer.Option("--store", help="Folder or address of the store.")]
RunFolders = Annotated[
    list[Path] | None,
    typer.Option(
        "--runs",
        metavar="DIR...",
        help="Folders with further runs, anywhere below: moved ones, or of other machines.",
    ),
]


@store_app.command("ls", cls=ListOptions)
def list_artifacts(store: Address = None, runs: RunFolders = None) -> None:
    """List artifacts: age since last use, size, seconds of work, who needs them, what is broken."""
    from flows.store_table import artifact_table, summary
    from flows.user_folders import this_machine
    from mocoflow_core.io.garbage import users

    now, machine = time.time(), this_machine()
    places = _places(store)
    needed = users([*_known(places), *_below(runs, machine)], machine)
    for place in places:
        held = place.look()
        typer.echo(f"{place.place}: {summary(held)}")
        for line in artifact_table(held, needed, now):
            typer.echo(line)


@store_app.command("verify")
def verify(
    store: Address = None,
    remove: Annotated[
        bool,
        typer.Option(
            "--remove", help="Remove what is damaged: the next run uploads or computes it anew."
        ),
    ] = False,
) -> None:
    """Read everything and compare its digests; exit code 1 where an artifact is damaged."""
    begun = time.time()
    damaged = [pair for place in _places(store) for pair in _damaged(place, place.look())]
    typer.echo(f"{len(damaged)} damaged" if damaged else "Nothing is damaged.")
    if remove:
        # Of use to nobody, also where a run needs it; what was written since begun may be whole.
        removed = [p.remove(replace(item, used_at=begun), lambda: False) for p, item in damaged]
        typer.echo(f"{sum(removed)} removed: the next run uploads or computes them anew.")
    elif damaged:
        typer.echo(
            "A run that needs a damaged artifact computes it again, but on object storage not the "
            "machine that holds it whole: --remove lets that one upload it."
        )
    if damaged:
        raise typer.Exit(1)


@store_app.command("gc", cls=ListOptions)
def collect_garbage(
    store: Address = None,
    runs: RunFolders = None,
    older_than: Annotated[
        float,
        typer.Option(
            metavar="DAYS",
            help="Keep what was used since; on object storage at least one hour's.",
            min=0.0,
        ),
    ] = 7.0,
    delete: Annotated[bool, typer.Option("--delete", help="Do it, instead of saying it.")] = False,
) -> None:
    """Say what no run needs any more, and with --delete remove it."""
    from flows.store_table import garbage_table, size
    from flows.user_folders import this_machine
    from mocoflow_core.io.garbage import is_needed, judge, users

    places, machine = _places(store), this_machine()
    elsewhere = _below(runs, machine)
    gone = [run for run in _known(places) if not run.is_kept(machine)]
    for run in gone:
        typer.echo(f"no longer there: the run in {run.folder}")

    def known() -> list[KnownRun]:
        return [*_known(places), *elsewhere]

    def removed(place: Holdings, going: Sentence) -> bool:
        return place.remove(going.held, lambda: is_needed(going, known(), machine))

    freed = 0
    for place in places:
        least_s = max(older_than * DAY_S, place.least_age_s)
        held = place.look()
        # Not before: what the look has found may be in a record that was just written.
        sentences = judge(held, users(known(), machine), least_s, time.time())
        for line in garbage_table(place.place, sentences):
            typer.echo(line)
        going = [sentence for sentence in sentences if sentence.goes]
        freed += sum(s.held.size for s in going if not delete or removed(place, s))
        for run in gone if delete else ():
            if not run.is_kept(machine):
                place.forget(run)
    typer.echo(f"{size(freed)} freed." if delete else f"{size(freed)} can go: add --delete.")


def _places(store: str | None) -> tuple[Holdings, ...]:
    from flows.users_store import open_users_store
    from mocoflow_core.io.remote_holdings import holdings_of

    return holdings_of(open_users_store(store))


def _damaged(place: Holdings, held: Sequence[Held]) -> list[tuple[Holdings, Held]]:
    """Read a place's artifacts and say what is wrong with each; leftovers are not counted."""
    from flows.store_table import summary
    from tasks.terminal_bar import terminal_bar

    damaged = []
    with terminal_bar("verify") as progress:
        for done, item in enumerate(held):
            progress(done / len(held), item.name)
            fault = item.fault if item.leftover else item.fault or place.verify(item)
            if fault:
                typer.echo(f"{'leftover' if item.leftover else 'damaged'} {item.name}: {fault}")
            if fault and not item.leftover:
                damaged.append((place, item))
    typer.echo(f"{place.place}: {summary(held)}")
    return damaged


def _known(places: Sequence[Holdings]) -> list[KnownRun]:
    """The runs that the store knows of by now."""
    return [run for place in places for run in place.runs()]


def _below(folders: list[Path] | None, machine: str) -> list[KnownRun]:
    """The runs below the given folders."""
    from mocoflow_core.io.known_runs import runs_below

    return runs_below(folders or (), machine)
