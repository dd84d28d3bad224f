"""Whatever a name says, it is read as it is written: no tag, link or table comes of it."""

from __future__ import annotations

from html.parser import HTMLParser

import pytest
from markdown_it import MarkdownIt

from mocoflow_core.methods.benchmark_folder import CellRecord
from mocoflow_core.metrics.benchmark_tables import Contender
from mocoflow_core.metrics.curve import CurveRow
from mocoflow_core.metrics.history import HistoryRow
from mocoflow_core.metrics.misalignment import MisalignmentRow
from mocoflow_core.metrics.table import ScoreRow
from mocoflow_core.metrics.time_to_target import Target, times_to_targets
from mocoflow_core.report.benchmark_page import write_benchmark_page
from mocoflow_core.report.benchmark_results import BenchmarkResults
from mocoflow_core.report.inputs import ReportInputs
from mocoflow_core.report.markdown_tables import write_markdown_tables
from mocoflow_core.report.markdown_text import code, plain, unlinked
from mocoflow_core.report.page import write_report
from mocoflow_core.report.stability_page import write_stability
from mocoflow_core.stability.table import StabilityRow
from tests.hostile_names import ADDRESS, HOSTILE


class Structure(HTMLParser):
    """All tags of a page with the names of their attributes, and its text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple] = []
        self.text = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, tuple(name for name, _ in attrs)))

    def handle_endtag(self, tag):
        self.tags.append((f"/{tag}",))

    def handle_comment(self, data):
        self.tags.append(("comment",))

    def handle_data(self, data):
        self.text += data


def benchmark_of(name: str) -> BenchmarkResults:
    contender = Contender(name, "fast", "mocoflow")
    protocol = f"as {name}"
    scores = {
        contender: {
            seed: [ScoreRow(name, "mocoflow", seed, name, 0, "psnr_union", 20.0 + seed, protocol)]
            for seed in (0, 1)
        }
    }
    curves = {
        contender: {
            seed: [
                CurveRow(name, "mocoflow", seed, "optimise_scene", 1, t, t, "psnr_union", value)
                for t, value in ((4.0, 15.0), (30.0, 20.0))
            ]
            for seed in (0, 1)
        }
    }
    known = {"scene": name, "preset": "fast", "method": "mocoflow", "folder": name}
    cells = [
        CellRecord(**known, seed=0, state="finished", train_camera=name, warnings=(name,)),
        CellRecord(**known, seed=1, state="failed", reason=name, guard_events=(name,)),
    ]
    times = times_to_targets(curves, [Target("psnr_union", 33.0)])
    moved = [MisalignmentRow(name, "shifted", 10.0, "px", 2.5, "psnr", 17.0, 3, protocol)]
    past = [HistoryRow(f"n{n}", name, *contender, "psnr_union", 30.0) for n in range(3)]
    return BenchmarkResults(cells, scores, curves, times, moved, past=past)


def benchmark_page(name, folder):
    write_benchmark_page(benchmark_of(name), f"mocoflow {name}", folder / "page.html")


def run_page(name, folder):
    run = {
        "scene": name,
        "preset": name,
        "remarks": [name],
        "machine": {"model": name},
        "configuration": {"capture": {"train_camera": name}},
        "license": name,
        "attribution": name,
        "command": name,
    }
    decision = {"name": name, "needed": True, "reason": name, "evidence": {name: 1.0}}
    inputs = ReportInputs(
        run=run, decisions=[decision], warnings=[name], guard_events=[name], held_out=name
    )
    write_report(inputs, folder / "page.html")


def stability_page(name, folder):
    row = StabilityRow(
        area="se3",
        case="exponential",
        parameter="angle, rad",
        value="1",
        number=1.0,
        error=0.5,
        bound=1.0,
        unit="m",
        finite=True,
        passed=True,
        remark=name,
        seconds=0.1,
    )
    write_stability(
        [row], {"model": name, "system": "", "python": "3", "cores": 1, "load": 0.0}, folder
    )
    (folder / "stability.html").rename(folder / "page.html")


@pytest.mark.parametrize("write", [benchmark_page, run_page, stability_page])
def test_no_page_has_a_tag_more_or_an_attribute_more(write, tmp_path):
    write("harmless", tmp_path)
    harmless = Structure((tmp_path / "page.html").read_text())
    assert "harmless" in harmless.text
    for name in HOSTILE:
        write(name, tmp_path)
        page = Structure((tmp_path / "page.html").read_text())
        assert page.tags == harmless.tags, name
        assert " ".join(name.split()) in " ".join(page.text.split())


def test_the_markdown_of_a_benchmark_has_no_block_more_and_nothing_inside_but_text(tmp_path):
    def read(name: str):
        write_markdown_tables(benchmark_of(name), f"mocoflow {name}", tmp_path / "table.md")
        parsed = MarkdownIt("gfm-like", {"linkify": False, "html": True})
        return parsed.parse((tmp_path / "table.md").read_text())

    harmless = [token.type for token in read("harmless")]
    for name in HOSTILE:
        tokens = read(name)
        assert [token.type for token in tokens] == harmless, name
        assert inline(tokens) <= {
            "text",
            "text_special",
            "code_inline",
            "strong_open",
            "strong_close",
        }


def inline(tokens) -> set[str]:
    return {child.type for token in tokens for child in token.children or ()}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_name_in_markdown_is_read_as_it_is_written(name):
    parsed = MarkdownIt("gfm-like", {"linkify": False, "html": True})
    written = " ".join(name.split())
    for text, kinds in ((plain(name), {"text"}), (code(name), {"text", "code_inline"})):
        tokens = parsed.parse(f"as {text} said")
        assert inline(tokens) <= kinds
        read = "".join(c.content for t in tokens for c in t.children or ())
        assert read.replace("\u2060", "") == f"as {written} said"
        assert kinds != {"text"} or not ADDRESS.search(read)
        [table] = [
            t
            for t in parsed.parse(f"| a | b |\n|-|-|\n| {plain(name)} | end |")
            if t.type == "inline" and t.content == "end"
        ]
        assert table


@pytest.mark.parametrize("name", ["turn_noise6", "data@cam02", "turn,seed=1", "Anna 2, left"])
def test_usual_names_stand_as_they_are(name):
    assert plain(name) == name
    assert code(name) == f"`{name}`"
    assert unlinked(name) == name


def test_a_cell_that_would_be_a_link_is_none():
    assert "](" not in unlinked("[here](javascript:alert(1)) ](](")
