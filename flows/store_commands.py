"""Commands about the artifact store: what it holds, whether that is whole, what can go."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flows.list_options import ListOptions

if TYPE_CHECKING:
    from mocoflow_core.io.holdings import Holdings
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
    from mocoflow_core.io.garbage import users

    now = time.time()
    places = _places(store)
    needed = users(_known(places, runs))
    for place in places:
        held = place.look()
        typer.echo(f"{place.place}: {summary(held)}")
        for line in artifact_table(held, needed, now):
            typer.echo(line)


@store_app.command("verify")
def verify(store: Address = None) -> None:
    """Read everything and compare its digests; exit code 1 where an artifact is damaged."""
    from flows.store_table import summary
    from tasks.terminal_bar import terminal_bar

    damaged = 0
    for place in _places(store):
        held = place.look()
        with terminal_bar("verify") as progress:
            for done, item in enumerate(held):
                progress(done / len(held), item.name)
                fault = item.fault if item.leftover else item.fault or place.verify(item)
                damaged += bool(fault) and not item.leftover
                if fault:
                    typer.echo(f"{'leftover' if item.leftover else 'damaged'} {item.name}: {fault}")
        typer.echo(f"{place.place}: {summary(held)}")
    typer.echo(f"{damaged} damaged" if damaged else "Nothing is damaged.")
    if damaged:
        typer.echo("A run that needs a damaged artifact computes it again.")
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
    from mocoflow_core.io.garbage import judge, users

    places = _places(store)
    known = _known(places, runs)
    for run in (run for run in known if not run.is_kept()):
        typer.echo(f"no longer there: the run in {run.folder}")
    freed = 0
    for place in places:
        least_s = max(older_than * DAY_S, place.least_age_s)
        sentences = judge(place.look(), users(known), least_s, time.time())
        for line in garbage_table(place.place, sentences):
            typer.echo(line)
        going = [sentence.held for sentence in sentences if sentence.goes]
        freed += sum(held.size for held in going if not delete or place.remove(held))
        for run in known if delete else ():
            if not run.is_kept():
                place.forget(run)
    typer.echo(f"{size(freed)} freed." if delete else f"{size(freed)} can go: add --delete.")


def _places(store: str | None) -> tuple[Holdings, ...]:
    from flows.users_store import open_users_store
    from mocoflow_core.io.remote_holdings import holdings_of

    return holdings_of(open_users_store(store))


def _known(places: Sequence[Holdings], folders: list[Path] | None) -> list[KnownRun]:
    """The runs that the store knows of, and those below the given folders."""
    from mocoflow_core.io.known_runs import runs_below

    return [*(run for place in places for run in place.runs()), *runs_below(folders or ())]
