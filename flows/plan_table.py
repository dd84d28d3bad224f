"""The plan of a run as tables: on Prefect's page and in a terminal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import get_args

from prefect.artifacts import create_table_artifact
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from flows.request import Request
from mocoflow_core.artifacts import PlanArtifact
from mocoflow_core.planning.decision import Decision, Part
from mocoflow_core.planning.plan import ScenePlan
from mocoflow_core.planning.scoring import decide_evaluation
from mocoflow_core.report.markdown_text import plain, unlinked_rows

_WORDS = {True: "needed", False: "left out"}


def show_plan(request: Request, made: PlanArtifact) -> ScenePlan:
    """Put the plan on the run's page, with what scoring can use; give it back."""
    text = (request.store.folder(made) / "plan.json").read_text()
    plan = ScenePlan.model_validate_json(text)
    decisions = (*plan.decisions, decide_evaluation(request.scene))
    show_decisions(request.scene.description.name, decisions)
    return plan


def show_decisions(scene: str, decisions: Iterable[Decision]) -> None:
    """On the run's page: what a scene needs and what not, and why."""
    rows = unlinked_rows({"part": decision.part, **_row(decision)} for decision in decisions)
    create_table_artifact(rows, key="plan", description=f"What {plain(scene)} needs")


def print_plan(plan: ScenePlan, console: Console) -> None:
    """One table for each part of the run."""
    for part in get_args(Part):
        decisions = [decision for decision in plan.decisions if decision.part == part]
        if decisions:
            console.print(_table(part, decisions))
    shell = f"Shell of {1000 * plan.shell_width_m:.0f} mm around the body, canonical"
    console.print(
        f"{shell if plan.shell_width_m else 'Canonical'} frame {plan.canonical_frame}, "
        f"{100 * plan.unseen_share:.0f} % of the surface never seen."
    )


def _table(part: str, decisions: list[Decision]) -> Table:
    table = Table("", "", f"What the {part} needs, and why", box=SIMPLE_HEAD, show_edge=False)
    for decision in decisions:
        row = _row(decision)
        measured = f"measured {row['evidence']}; threshold {row['threshold']}"
        why = f"{row['reason']}\n[dim]{measured}\nleaving it out saves {row['saves']}[/dim]"
        table.add_row(row["name"], row["decision"], why, style="bold" if decision.needed else "")
    return table


def _row(decision: Decision) -> dict[str, str]:
    return {
        "name": decision.name.replace("_", " "),
        "decision": _WORDS[decision.needed],
        "reason": decision.reason,
        "evidence": ", ".join(f"{name} {value:.3g}" for name, value in decision.evidence.items()),
        "threshold": "" if decision.threshold is None else f"{decision.threshold:.3g}",
        "saves": decision.saves,
    }
