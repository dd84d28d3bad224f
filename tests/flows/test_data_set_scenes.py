"""A data set's name stands for the recordings below its root, and needs the root."""

from __future__ import annotations

import pytest

from flows.benchmark_scenes import read_scenes
from mocoflow_core.errors import InputError

SEQUENCES = ("gBR_sBM_cAll_d04_mBR0_ch01", "gWA_sFM_cAll_d27_mWA5_ch20")


@pytest.fixture
def aist(tmp_path, monkeypatch):
    (tmp_path / "videos").mkdir()
    for name in SEQUENCES:
        for camera in ("c01", "c09"):
            (tmp_path / "videos" / f"{name.replace('cAll', camera)}.mp4").touch()
    monkeypatch.setenv("MOCOFLOW_AIST_ROOT", str(tmp_path))
    return tmp_path


def test_every_sequence_of_aist_is_a_scene_with_its_choice(aist):
    scenes = read_scenes(["aist@c01"])
    assert [scene.name for scene in scenes] == [f"{name}@c01" for name in SEQUENCES]
    assert [scene.import_settings for scene in scenes] == [(f"sequence={n}",) for n in SEQUENCES]
    assert {scene.folder() for scene in scenes} == {aist}


def test_one_recording_can_be_named(aist):
    [scene] = read_scenes([f"aist:{SEQUENCES[1]}"])
    assert scene.name == SEQUENCES[1]
    with pytest.raises(InputError, match="a recording of aist"):
        read_scenes(["aist:gXX"])


def test_every_subject_of_zju_mocap_is_a_scene(tmp_path, monkeypatch):
    for name in ("CoreView_313", "CoreView_377", "notes"):
        (tmp_path / name).mkdir()
    for name in ("CoreView_313", "CoreView_377"):
        (tmp_path / name / "annots.npy").touch()
    monkeypatch.setenv("MOCOFLOW_ZJU_MOCAP_ROOT", str(tmp_path))
    assert [s.name for s in read_scenes(["zju-mocap"])] == ["CoreView_313", "CoreView_377"]


@pytest.mark.parametrize("data_set", ["aist", "zju-mocap", "people-snapshot"])
def test_without_its_root_a_data_set_names_the_variable_to_set(data_set, monkeypatch):
    variable = f"MOCOFLOW_{data_set.upper().replace('-', '_')}_ROOT"
    monkeypatch.delenv(variable, raising=False)
    with pytest.raises(InputError, match=variable):
        read_scenes([data_set])


def test_a_root_without_recordings_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("MOCOFLOW_PEOPLE_SNAPSHOT_ROOT", str(tmp_path))
    with pytest.raises(InputError, match="a recording of people-snapshot"):
        read_scenes(["people-snapshot"])
