"""What goes wrong with ROMP's and BEV's files, and does not here."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from tests.estimators.layouts import Person, romp_people, write_romp


@pytest.fixture
def write(tmp_path):
    return lambda frames, **options: write_romp(tmp_path / "out", frames, **options)


def placed(estimate):
    return estimate.vertices + estimate.first_translations[:, None]


def alone(person, **options):
    return {row: romp_people([person], row, **options) for row in range(len(person))}


def test_frames_without_a_file_are_gaps(write, person, read, faces_file):
    frames = alone(person)
    frames = {2: frames[0], 3: frames[1], 7: frames[2], 8: frames[3]}
    estimate = read(write(frames), faces=faces_file)
    assert estimate.frame_indices.tolist() == [2, 3, 7, 8]
    assert estimate.numbering == "source"
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)


@pytest.mark.parametrize("tracked", [False, True])
def test_people_in_changing_order_are_kept_apart(write, person, smpl, read, faces_file, tracked):
    other = Person.of(smpl, seed=1)
    other.translations[:, 0] += 1.5
    frames = {}
    for row in range(4):
        people = [person, other] if row % 2 else [other, person]
        frames[row] = romp_people(people, row)
        if tracked:
            ids = [4, 9] if row % 2 else [9, 4]
            frames[row]["track_ids"] = np.array(ids, np.int32)
    path = write(frames)
    ids = (9, 4) if tracked else (0, 1)
    for person_id, body in zip(ids, (other, person), strict=True):
        estimate = read(path, faces=faces_file, person=person_id)
        assert np.allclose(placed(estimate), body.vertices, atol=2e-4)
    followed = any("followed by their place" in remark for remark in estimate.remarks)
    assert followed is not tracked


def test_bevs_camera_is_flipped(write, person, read, faces_file):
    frames = alone(person, bev=True)
    for people in frames.values():
        people.pop("cam_trans")
    estimate = read(write(frames), faces=faces_file)
    assert estimate.source == "BEV"
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)


def test_bev_without_meshes_measures_from_the_hips(write, person, read, smpl_file):
    estimate = read(write(alone(person, meshes=False, bev=True)), body_model=smpl_file)
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)


def test_a_childs_share_of_the_shape_is_said_to_be_left_out(write, person, read, smpl_file):
    frames = alone(person, meshes=False, bev=True)
    for people in frames.values():
        people["smpl_betas"][:, 10] = 0.7
    estimate = read(write(frames), body_model=smpl_file)
    assert any("child's share" in remark for remark in estimate.remarks)


def test_romps_crude_translation_is_not_believed(write, person, read, smpl_file):
    frames = alone(person, meshes=False)
    estimate = read(write(frames), body_model=smpl_file)
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)
    crude = np.stack([people["cam_trans"][0] for people in frames.values()])
    assert np.abs(crude - estimate.first_translations).max() > 0.3


def test_a_single_person_may_come_without_the_axis_of_people(write, person, read, faces_file):
    frames = {
        row: {name: part[0] for name, part in people.items()}
        for row, people in alone(person).items()
    }
    assert np.allclose(placed(read(write(frames), faces=faces_file)), person.vertices, atol=2e-4)


def test_faces_were_deleted_before_saving(write, person, read):
    with pytest.raises(InputError, match=r"ROMP stores no faces.*--body-model"):
        read(write(alone(person)))


def test_without_meshes_the_model_is_asked_for(write, person, read, faces_file):
    with pytest.raises(InputError, match=r"ROMP stores pose and shape.*--body-model"):
        read(write(alone(person, meshes=False)), faces=faces_file)


def test_the_videos_file_beside_its_frames_counts_once(write, person, read, faces_file):
    estimate = read(write(alone(person), video=True), faces=faces_file)
    assert estimate.frame_indices.tolist() == [0, 1, 2, 3]


def test_one_frames_file_is_one_frame(write, person, read, faces_file):
    path = write(alone(person)) / "00000002.npz"
    assert read(path, faces=faces_file).frame_indices.tolist() == [2]
