"""What Prefect's pages show of names: text, whatever they say."""

from __future__ import annotations

import pytest
from markdown_it import MarkdownIt

from flows import run_facts
from mocoflow_core.io.run_folder import RunRecord
from mocoflow_core.methods.benchmark_folder import BenchmarkRecord
from tests.hostile_names import HOSTILE


@pytest.fixture
def shown(monkeypatch) -> list[tuple]:
    """What Prefect is given: the content and the description of each artifact."""
    given: list[tuple] = []
    for kind in ("table", "markdown"):
        monkeypatch.setattr(
            run_facts,
            f"create_{kind}_artifact",
            lambda content, key, description: given.append((content, description)),
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
    )
    run_facts.show_benchmark_in_prefect(record, folder / name.replace("/", ""), folder / "none")


def kinds(text: str) -> tuple[list[str], set[str]]:
    """The blocks of a Markdown text, and what is inside them."""
    tokens = MarkdownIt("gfm-like", {"linkify": False, "html": True}).parse(text)
    inside = {child.type for token in tokens for child in token.children or ()}
    return [token.type for token in tokens], inside


@pytest.mark.parametrize("show", [run_page, benchmark_page])
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
            else:
                assert all("](" not in str(value) for row in content for value in row.values())
