"""``python -m flows.production up | down | deploy``, from the repository's root."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from flows.production.deploy_site import deploy_site
from flows.production.site import MARK, Database, Site, default_folder
from flows.production.up import bring_up, take_down
from mocoflow_core.errors import InputError

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
State = Annotated[Path, typer.Option(help="Folder of its state.", default_factory=default_folder)]


@app.command()
def up(
    state: State,
    database: Annotated[Database | None, typer.Option(help="Of a new site.")] = None,
    port: Annotated[int | None, typer.Option(help="Of the server.", min=1, max=65535)] = None,
) -> None:
    """Start database, server and worker on this machine, with all deployments; again is fine.

    A site keeps its database and port; a new one has sqlite and 4200 unless told otherwise.
    """
    for line in bring_up(Site.asked_for(state.resolve(), port, database)):
        typer.echo(line)


@app.command()
def down(state: State) -> None:
    """Cancel the runs and end all processes of this machine's site."""
    site = Site.of_folder(state.resolve())
    was_running = False
    for line in take_down(site) if site else ():
        was_running = True
        typer.echo(line)
    if not was_running:
        typer.echo(f"Nothing of {state} is running.")


@app.command()
def deploy(state: State) -> None:
    """Make pool, automations, deployments and schedules: of this machine's site, or elsewhere.

    Elsewhere is the server of PREFECT_API_URL, with the variables of the environment.
    """
    if site := _site_meant(state.resolve()):
        deploy_site(site)
        return
    from flows.production.deploy import deploy as bring_up_to_date

    for line in bring_up_to_date():
        typer.echo(line)


def _site_meant(folder: Path) -> Site | None:
    """The site in a folder, unless another server is asked for, or this is a process of the site.

    Raises InputError where there is neither.
    """
    site, server = Site.of_folder(folder), os.environ.get("PREFECT_API_URL")
    if os.environ.get(MARK) == str(folder):
        return None
    if site and (not server or site.is_at(server)):
        return site
    if server:
        return None
    raise InputError(
        "PREFECT_API_URL, or a site that `make up` has made",
        f"neither, and none in {folder}",
        "make up, or export PREFECT_API_URL=http://HOST:4200/api.",
    )


if __name__ == "__main__":
    try:
        app()
    except InputError as error:
        typer.echo("mocoflow: " + " ".join(str(error).split()), err=True)
        sys.exit(2)
    except RuntimeError as error:
        typer.echo(f"mocoflow: {error}", err=True)
        sys.exit(1)
