"""The kind of an estimate is told by what is in it, whatever it is called."""

from __future__ import annotations

import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.detect import detect
from mocoflow_core.estimators.estimate_file import EstimateFile
from tests.estimators import layouts
from tests.estimators.layouts import Person


class Planted:
    """Leaves a file where it is unpickled by anything that runs what it is told."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self):
        return Path.touch, (self.trace,)


@pytest.fixture
def written(person, smplx, tmp_path):
    """A path of each kind, by kind."""
    rows = range(len(person))
    romp = {row: layouts.romp_people([person], row) for row in rows}
    native = tmp_path / "meshes.npz"
    np.savez(native, vertices=person.vertices, faces=person.model.faces, frame_indices=rows)
    motion = tmp_path / "motion.pkl"
    motion.write_bytes(pickle.dumps(layouts.aist_motion(person), protocol=4))
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    (meshes / "1.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    people = layouts.write_people
    return {
        "native": native,
        "vibe": people(tmp_path / "a", {7: layouts.vibe_record(person)}),
        "pare": people(tmp_path / "b", {1: layouts.pare_record(person)}),
        "wham": layouts.write_wham(tmp_path / "c", {0: layouts.wham_record(person)}),
        "phalp": people(tmp_path / "d", layouts.phalp_frames({1: person}), compress=3),
        "gvhmr": layouts.write_gvhmr(tmp_path / "e.pt", Person.of(smplx)),
        "tram": layouts.write_tram(tmp_path / "f", [person]),
        "romp": layouts.write_romp(tmp_path / "g", romp),
        "aist_motion": motion,
        "easymocap": layouts.write_zju(tmp_path / "h", layouts.easymocap_frames(person)),
        "mesh_folder": meshes,
    }


def test_every_kind_is_told_by_its_content_under_any_name(written, tmp_path):
    for kind, path in written.items():
        renamed = tmp_path / "vibe_output.pkl"
        (shutil.copytree if path.is_dir() else shutil.copy)(path, renamed)
        assert detect(EstimateFile(renamed)) == kind
        (shutil.rmtree if path.is_dir() else Path.unlink)(renamed)


def test_the_api_of_wham_is_wham(person, tmp_path):
    path = layouts.write_wham(tmp_path / "a.pkl", {0: layouts.wham_api_record(person)})
    assert detect(EstimateFile(path)) == "wham"


def test_what_could_be_two_kinds_is_asked_about(person, read, faces_file, tmp_path):
    both = layouts.vibe_record(person) | layouts.wham_record(person)
    path = layouts.write_people(tmp_path / "a.pkl", {1: both})
    with pytest.raises(InputError, match=r"vibe or wham.*--set meshes\.kind=vibe"):
        detect(EstimateFile(path))
    assert read(path, kind="wham", faces=faces_file).source == "WHAM"


def test_an_unknown_dictionary_is_refused_with_its_keys_and_the_kinds_there_are(tmp_path):
    path = layouts.write_people(tmp_path / "a.pkl", {"weights": np.zeros(3), "bias": 1.0})
    with pytest.raises(InputError, match=r"vibe \(VIBE\).*a dictionary with weights, bias"):
        detect(EstimateFile(path))


def test_an_unknown_folder_is_refused_with_its_files(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "notes.txt").write_text("nothing")
    with pytest.raises(InputError, match=r"a folder with notes\.txt"):
        detect(EstimateFile(tmp_path / "a"))


def test_a_kind_that_is_forced_on_something_else_is_refused_in_its_words(read, person, tmp_path):
    path = layouts.write_people(tmp_path / "a.pkl", {1: layouts.vibe_record(person)})
    with pytest.raises(InputError, match="hmr4d_results"):
        read(path, kind="gvhmr")


@pytest.mark.parametrize(
    "write",
    [
        lambda path, content: path.write_bytes(pickle.dumps({1: content})),
        lambda path, content: layouts.write_people(path, {1: content}),
        lambda path, content: np.save(path.open("wb"), {1: content}, allow_pickle=True),
        lambda path, content: np.savez(path.open("wb"), results=np.array({1: content}, object)),
    ],
)
def test_a_file_that_wants_to_run_something_is_refused_and_nothing_runs(write, tmp_path):
    trace, path = tmp_path / "trace", tmp_path / "estimate"
    write(path, Planted(trace))
    with pytest.raises(InputError):
        detect(EstimateFile(path))
    assert not trace.exists()


def test_settings_that_a_kind_does_not_read_are_refused(read, person, tmp_path):
    path = layouts.write_wham(tmp_path / "a.pkl", {0: layouts.wham_record(person)})
    with pytest.raises(InputError, match=r"meshes\.crop_factor needs .*VIBE; PARE.*one of WHAM"):
        read(path, crop_factor=1.2)
