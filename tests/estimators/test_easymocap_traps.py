"""What goes wrong with EasyMocap's and ZJU-MoCap's parameters, and does not here."""

from __future__ import annotations

import json

import numpy as np
import pytest

from mocoflow_core.body.blend_skinning import posed_vertices
from mocoflow_core.errors import InputError
from tests.estimators.layouts import easymocap_frames, write_easymocap, write_zju


def test_frames_are_named_by_the_pictures_numbers_and_some_are_missing(
    person, read, smpl_file, tmp_path
):
    folder = write_zju(tmp_path / "new_params", easymocap_frames(person), first=9)
    (folder / "10.npy").unlink()
    estimate = read(folder, body_model=smpl_file)
    assert estimate.frame_indices.tolist() == [9, 11, 12]
    assert np.allclose(estimate.vertices, person.vertices[[0, 2, 3]], atol=2e-5)


def test_old_params_are_posed_without_blend_shapes_when_told(
    person, read, smpl, smpl_file, tmp_path
):
    folder = write_zju(tmp_path / "params", easymocap_frames(person))
    told = read(folder, body_model=smpl_file, pose_blend_shapes="off")
    plain = posed_vertices(smpl, person.pose, person.betas, pose_directions=False)
    shape = plain - plain.mean(axis=1, keepdims=True)
    found = told.vertices - told.vertices.mean(axis=1, keepdims=True)
    assert np.allclose(found, shape, atol=2e-5)
    unsaid = read(folder, body_model=smpl_file)
    assert np.abs(unsaid.vertices - told.vertices).max() > 1e-3
    assert any("pose_blend_shapes=off" in remark for remark in unsaid.remarks)
    assert not any("pose_blend_shapes=off" in remark for remark in told.remarks)


def test_people_of_a_frame_are_told_by_id(person, read, smpl_file, tmp_path):
    folder = write_easymocap(tmp_path / "smpl", easymocap_frames(person), person=2)
    for path in sorted(folder.iterdir())[1:]:
        [record] = json.loads(path.read_text())
        other = {**record, "id": 5, "Th": [[0.0, 0.0, 9.0]]}
        path.write_text(json.dumps([other, record]))
    estimate = read(folder, body_model=smpl_file)
    assert np.allclose(estimate.vertices, person.vertices, atol=2e-5)
    assert "person 2 (4 frames), person 5 (3 frames)" in estimate.remarks[0]
    assert read(folder, body_model=smpl_file, person=5).frame_indices.tolist() == [1, 2, 3]


def test_a_frame_without_people_is_a_gap(person, read, smpl_file, tmp_path):
    folder = write_easymocap(tmp_path / "smpl", easymocap_frames(person))
    (folder / "000000.json").write_text("[]")
    assert read(folder, body_model=smpl_file).frame_indices.tolist() == [1, 2, 3]


def test_bodies_of_smplx_are_refused(person, read, smpl_file, tmp_path):
    records = easymocap_frames(person)
    for record in records:
        record["poses"] = np.zeros((1, 87), np.float32)
    folder = write_zju(tmp_path / "smplx", records)
    with pytest.raises(InputError, match=r"poses of 72 finite numbers in .*SMPL's"):
        read(folder, body_model=smpl_file)


def test_another_file_among_them_is_refused_by_name(person, read, smpl_file, tmp_path):
    folder = write_zju(tmp_path / "new_params", easymocap_frames(person))
    np.save(folder / "7.npy", np.zeros((6890, 3)))
    with pytest.raises(InputError, match=r"7\.npy"):
        read(folder, body_model=smpl_file)


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ({"Th": np.full((1, 3), np.nan)}, r"Th of 3 finite numbers in 2\.npy"),
        ({"shapes": np.zeros((1, 16))}, "10 and 16 numbers"),
    ],
)
def test_spoilt_parameters_are_refused(person, read, smpl_file, tmp_path, spoilt, words):
    records = easymocap_frames(person)
    records[2] |= spoilt
    with pytest.raises(InputError, match=words):
        read(write_zju(tmp_path / "new_params", records), body_model=smpl_file)


def test_more_shape_than_the_model_has_is_refused(person, read, smpl_file, tmp_path):
    records = [{**record, "shapes": np.ones((1, 400))} for record in easymocap_frames(person)]
    with pytest.raises(InputError, match="400 shape directions"):
        read(write_zju(tmp_path / "new_params", records), body_model=smpl_file)
