"""What Prefect's pages show of names: text, whatever they say."""

from __future__ import annotations

import re
from pathlib import Path
from uuid import uuid4

import pytest
from markdown_it import MarkdownIt

from flows import plan_table, run_facts
from mocoflow_core.io.run_folder import RunRecord
from mocoflow_core.methods.benchmark_folder import BenchmarkRecord
from mocoflow_core.planning.decision import Decision
from tasks import progress
from tests.hostile_names import ADDRESS, HOSTILE

# What goes into those of other files is our own: numbers, and names of the catalogue.
WITH_NAMES = {"flows/run_facts.py", "flows/plan_table.py", "tasks/progress.py"}
WITHOUT = {"flows/stability.py", "tasks/growing_curve.py"}


@pytest.fixture
def shown(monkeypatch) -> list[tuple]:
    """What Prefect is given: the content and the description of each artifact."""
    given: list[tuple] = []

    def create(content, key, description):
        given.append((content, description))
        return uuid4()

    for module in (run_facts, plan_table, progress):
        for kind in ("table", "markdown", "progress"):
            if hasattr(module, f"create_{kind}_artifact"):
                monkeypatch.setattr(module, f"create_{kind}_artifact", create)
    monkeypatch.setattr(
        progress,
        "update_progress_artifact",
        lambda _, content, description: given.append((content, description)),
    )
    return given


def run_page(name, folder):
    record = RunRecord(
        request="",
        scene=name,
        scene_path="",
        preset="toy",
        seed=0,
        configuration={},
        store="",
        scores={"mocoflow": {name: {"psnr": 20.0}}},
    )
    run_facts.show_in_prefect(record, folder / name.replace("/", ""), folder / "no picture")


def benchmark_page(name, folder):
    record = BenchmarkRecord(
        settings=(),
        budget_s=None,
        command=f"mocoflow benchmark --scenes {name}",
        summary=({"scene": name, "metric": "psnr", "mean": 20.0},),
        omissions=({"what": name, "why": name},),
        regressions=({"what": name, "why": name},),
    )
    run_facts.show_benchmark_in_prefect(record, folder / name.replace("/", ""), folder / "none")


def plan_page(name, _):
    decision = Decision(name="masks", part="preparation", needed=True, reason=name, saves=name)
    plan_table.show_decisions(name, [decision])


def stage_progress(name, _):
    artifact = progress.ProgressArtifact("render_views")
    artifact.update(0.1, name)
    artifact.update(0.9, f"{name}/000001.png")


def kinds(text: str) -> tuple[list[str], set[str]]:
    """The blocks of a Markdown text, and what is inside them; no text is an address."""
    tokens = MarkdownIt("gfm-like", {"linkify": False, "html": True}).parse(text)
    inside = [child for token in tokens for child in token.children or ()]
    texts = [child.content for child in inside if child.type == "text"]
    assert not any(map(ADDRESS.search, texts)), texts
    return [token.type for token in tokens], {child.type for child in inside}


@pytest.mark.parametrize("show", [run_page, benchmark_page, plan_page, stage_progress])
def test_no_name_becomes_a_link_a_tag_or_a_row(show, shown, tmp_path):
    show("harmless", tmp_path)
    harmless = [(kinds(str(content)), kinds(said)) for content, said in shown]
    for name in HOSTILE:
        shown.clear()
        show(name, tmp_path)
        for (content, description), (page, above) in zip(shown, harmless, strict=True):
            assert kinds(description)[0] == above[0], name
            assert kinds(description)[1] <= {"text", "code_inline"}, name
            if isinstance(content, str):
                assert kinds(content)[0] == page[0], name
                assert kinds(content)[1] <= {"text", "code_inline"}, name
            elif isinstance(content, list):
                assert all("](" not in str(value) for row in content for value in row.values())


def test_an_artifact_that_is_made_elsewhere_is_looked_at_here_first():
    root = Path(__file__).parents[2]
    files = [file for folder in ("flows", "tasks") for file in (root / folder).rglob("*.py")]
    making = {
        str(file.relative_to(root))
        for file in files
        if re.search(r"create_\w+_artifact\(|ArtifactUpdate\(", file.read_text())
    }
    assert making == WITH_NAMES | WITHOUT
