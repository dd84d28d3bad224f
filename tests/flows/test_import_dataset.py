"""A data set in place of a scene: imported by command, or at first use."""

from __future__ import annotations

import json
import sys

import pytest

from flows.command_line import main
from flows.imported_scene import scene_folder, tell
from flows.request import Request
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.datasets.detect import detect_kind
from mocoflow_core.datasets.import_cache import import_key
from mocoflow_core.datasets.import_dataset import ImportedDataset, configure
from mocoflow_core.errors import InputError
from tests.datasets.snapshot_layout import turning, write_snapshot
from tests.small_smpl import write_smpl


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A subject and the body model that it needs."""
    folder = tmp_path_factory.mktemp("data")
    (folder / "mocoflow" / "body_models").mkdir(parents=True)
    model = folder / "mocoflow" / "body_models" / "SMPL_FEMALE.pkl"
    write_smpl(model, vertices=600)
    write_snapshot(folder / "female-9-casual", turning(6, 64, model))
    return folder


@pytest.fixture
def subject(data, monkeypatch, tmp_path):
    """Its folder; the user keeps body models where they are found, and has an empty cache."""
    monkeypatch.setenv("XDG_DATA_HOME", str(data))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    scene_folder.cache_clear()
    return data / "female-9-casual"


def run(monkeypatch, capsys, *arguments):
    monkeypatch.setattr(sys, "argv", ["mocoflow", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code, capsys.readouterr()


def test_import_writes_a_scene_and_says_what_it_assumed(monkeypatch, capsys, subject, tmp_path):
    out = tmp_path / "scene"
    wanted = ("import", "auto", subject, "--out", out, "--set", "stride=3")
    code, printed = run(monkeypatch, capsys, *wanted)
    assert code == 0
    assert str(out) in printed.out
    assert "6 frames, 6 masks, 6 poses" in printed.err
    assert open_scene(out).description.working_fps == 8.0
    record = json.loads((out / "import.json").read_text())
    assert record["kind"] == "people-snapshot"
    assert record["configuration"]["stride"] == 3
    assert any("one frame in 3" in remark for remark in record["remarks"])
    code, printed = run(monkeypatch, capsys, *wanted)
    assert code == 2
    assert "new or empty" in printed.err


@pytest.mark.parametrize(
    ("setting", "because"), [("strides=3", "stride"), ("stride=0", "stride must be valid")]
)
def test_a_wrong_choice_is_refused(monkeypatch, capsys, subject, tmp_path, setting, because):
    wanted = ("import", "people-snapshot", subject, "--out", tmp_path / "scene", "--set", setting)
    code, printed = run(monkeypatch, capsys, *wanted)
    assert code == 2
    assert because in printed.err
    assert not (tmp_path / "scene").exists()


def test_a_data_set_in_place_of_a_scene_is_imported_once(subject, capsys):
    first = scene_folder(subject, without_bodies=False)
    assert open_scene(first).description.name == "female-9-casual"
    assert "is people-snapshot: imported into" in capsys.readouterr().err
    scene_folder.cache_clear()
    assert scene_folder(subject, without_bodies=False) == first
    assert "imported before" in capsys.readouterr().err


def test_warnings_of_evaluation_cameras_are_counted_and_not_printed(capsys):
    tell(ImportedDataset("s", "front", (), {}, ("front is dark",), ("side: overlap 0.3",)))
    printed = capsys.readouterr().err
    assert "front is dark" in printed
    assert "0.3" not in printed
    assert "1 of evaluation cameras" in printed


def test_a_changed_file_or_choice_is_another_import(subject):
    kind = detect_kind(subject)
    keys = {import_key(subject, configure(kind, ("stride=2",), None))}
    keys |= {import_key(subject, configure(kind, ("stride=3",), None))}
    (subject / "camera.pkl").touch()
    keys |= {import_key(subject, configure(kind, ("stride=2",), None))}
    assert len(keys) == 3


def test_a_missing_body_model_is_named_with_the_command_for_every_choice(
    subject, monkeypatch, tmp_path
):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(InputError, match=r"--body-model.*mocoflow import people-snapshot"):
        scene_folder(subject, without_bodies=False)


def test_meshes_from_elsewhere_need_no_body_model(subject, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert open_scene(scene_folder(subject, without_bodies=True)).meshes() is None


def test_the_body_model_of_the_command_line_is_the_data_sets_too(subject, data, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(data / "elsewhere"))
    model = data / "mocoflow" / "body_models" / "SMPL_FEMALE.pkl"
    request = Request(scene_path=subject, settings=(f"meshes.body_model={model}",))
    assert request.scene.meshes() is not None


def test_a_scene_is_what_it_is(toy_scene):
    assert scene_folder(toy_scene, without_bodies=False) == toy_scene
    file = toy_scene / "scene.json"
    assert scene_folder(file, without_bodies=False) == file


def test_a_run_can_make_one_choice_of_its_data_sets_import(subject):
    def rate(*settings):
        return Request(scene_path=subject, import_settings=settings).scene.description.working_fps

    assert rate("stride=3") == 8.0
    assert rate() == 12.0


def test_a_choice_of_an_import_is_refused_where_nothing_is_imported(toy_scene):
    with pytest.raises(InputError, match="a data set, of whose import"):
        _ = Request(scene_path=toy_scene, import_settings=("stride=3",)).scene
