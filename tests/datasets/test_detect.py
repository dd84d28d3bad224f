"""A folder is recognised by what lies in it; what is none is told what it lacks."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mocoflow_core.datasets.detect import detect_kind, kind_of
from mocoflow_core.datasets.kinds import KINDS
from mocoflow_core.errors import InputError

SUBJECT = ("camera.pkl", "masks.hdf5", "reconstructed_poses.hdf5")


@pytest.fixture
def subject(tmp_path):
    """Only names are looked at: nothing is opened."""

    def make(name="data/female-3-casual", without=()):
        folder = tmp_path / name
        folder.mkdir(parents=True)
        for part in {*SUBJECT, f"{folder.name}.mp4"} - set(without):
            (folder / part).touch()
        return folder

    return make


def refusal(folder, **choices) -> str:
    with pytest.raises(InputError) as refused:
        detect_kind(folder, **choices)
    return str(refused.value)


def test_a_subject_of_people_snapshot_is_recognised(subject):
    assert detect_kind(subject()).name == "people-snapshot"


@pytest.mark.parametrize(
    ("kind", "files"),
    [
        ("zju-mocap", ("annots.npy", "Camera_B1/000000.jpg")),
        ("aist", ("gBR_sBM_c09_d04_mBR0_ch01.mp4", "cameras/mapping.txt")),
        ("aist", ("videos/gBR_sBM_c09_d04_mBR0_ch01.mp4", "annotations/cameras/mapping.txt")),
    ],
)
def test_the_other_kinds_are_recognised(tmp_path, kind, files):
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert detect_kind(tmp_path).name == kind


def test_what_is_missing_is_named_for_every_kind_the_nearest_first(subject):
    told = refusal(subject(without=("masks.hdf5",)))
    assert "people-snapshot lacks masks.hdf5" in told
    positions = [
        told.index(f"{name} lacks") for name, kind in KINDS.items() if kind.source == "folder"
    ]
    assert min(positions) == told.index("people-snapshot lacks")


def test_a_folder_of_subjects_lists_them(subject):
    for name in ("female-3-casual", "male-3-casual"):
        folder = subject(f"data/{name}")
    told = refusal(folder.parent)
    assert "2 of them (female-3-casual, male-3-casual)" in told
    assert f"Name one, as {folder.parent / 'female-3-casual'}" in told


def test_what_could_be_two_kinds_must_be_named(subject):
    known = KINDS["people-snapshot"]
    twice = {"people-snapshot": known, "twin": replace(known, name="twin")}
    assert "people-snapshot and twin" in refusal(subject(), kinds=twice)


def test_a_folder_that_is_not_there_is_refused(tmp_path):
    assert "nothing at" in refusal(tmp_path / "nowhere")


def test_a_kind_can_be_named_and_must_be_known(tmp_path, subject):
    assert kind_of("people-snapshot", tmp_path).name == "people-snapshot"
    assert kind_of("auto", subject()).name == "people-snapshot"
    with pytest.raises(InputError, match="people-snapshot"):
        kind_of("people_snapshot", tmp_path)
