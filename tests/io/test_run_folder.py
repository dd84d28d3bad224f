from __future__ import annotations

import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.io.run_folder import RunFolder, RunRecord, read_run


def begun(request="a"):
    return RunRecord(
        request=request,
        scene="toy",
        scene_path="/toy",
        preset="toy",
        seed=0,
        configuration={},
        store="store",
    )


@pytest.fixture
def finished(tmp_path):
    source = tmp_path / "report.html"
    source.write_text("page")
    folder = RunFolder.claim(tmp_path / "run", begun())
    folder.take(source, "report.html")
    folder.finish({"scores": {"psnr": 1.0}})
    return tmp_path / "run"


def test_a_finished_folder_is_found_finished_by_the_same_request(finished):
    assert RunFolder.claim(finished, begun()).is_finished()
    assert read_run(finished).scores == {"psnr": 1.0}


def test_another_request_is_refused(finished):
    with pytest.raises(InputError, match="another run"):
        RunFolder.claim(finished, begun("b"))


def test_a_lost_output_is_not_taken_for_finished(finished):
    (finished / "report.html").unlink()
    assert not RunFolder.claim(finished, begun()).is_finished()


def test_a_folder_with_something_else_is_refused_untouched(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="something else"):
        RunFolder.claim(tmp_path, begun())
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_file_where_the_folder_should_be_is_refused(tmp_path):
    (tmp_path / "run").write_text("a file")
    with pytest.raises(InputError, match="something else"):
        RunFolder.claim(tmp_path / "run", begun())


def test_an_unfinished_run_is_continued_but_cannot_be_rendered(tmp_path):
    RunFolder.claim(tmp_path / "run", begun())
    assert not RunFolder.claim(tmp_path / "run", begun()).is_finished()
    with pytest.raises(InputError, match="unfinished"):
        read_run(tmp_path / "run")


def test_what_is_taken_twice_is_replaced_whole(tmp_path):
    folder = RunFolder.claim(tmp_path / "run", begun())
    for number in range(2):
        views = tmp_path / f"views{number}"
        views.mkdir()
        (views / f"{number}.png").touch()
        folder.take(views, "views")
    assert [path.name for path in (tmp_path / "run" / "views").iterdir()] == ["1.png"]


def test_a_run_that_left_nothing_but_its_record_gives_its_folder_up(tmp_path):
    RunFolder.claim(tmp_path / "run", begun())
    RunFolder.claim(tmp_path / "run", begun("mended"))
    assert RunFolder.claim(tmp_path / "run", begun("mended")).begun.request == "mended"


def test_an_unfinished_run_with_results_keeps_its_folder(tmp_path):
    (tmp_path / "report.html").write_text("page")
    RunFolder.claim(tmp_path / "run", begun()).take(tmp_path / "report.html", "report.html")
    with pytest.raises(InputError, match="another run"):
        RunFolder.claim(tmp_path / "run", begun("b"))
