"""What goes wrong with WHAM, PHALP, GVHMR and TRAM, and does not here."""

from __future__ import annotations

import numpy as np
import pytest

from mocoflow_core.errors import InputError
from tests.estimators import layouts
from tests.estimators.layouts import Person


def said(estimate, words):
    return any(words in remark for remark in estimate.remarks)


def test_whams_vertices_include_their_translation(person, read, faces_file, tmp_path):
    path = layouts.write_wham(tmp_path / "wham_output.pkl", {4: layouts.wham_record(person)})
    estimate = read(path, faces=faces_file)
    assert np.allclose(estimate.vertices, person.vertices, atol=2e-4)
    assert said(estimate, "800 px where the camera's is 915 px")


def test_whams_focal_length_can_be_told_where_it_was_calibrated(person, read, faces_file, tmp_path):
    record = layouts.wham_record(person, focal_px=1200.0)
    path = layouts.write_wham(tmp_path / "wham_output.pkl", {0: record})
    assert not np.allclose(read(path, faces=faces_file).vertices, person.vertices, atol=0.1)
    estimate = read(path, faces=faces_file, focal_px=1200)
    assert np.allclose(estimate.vertices, person.vertices, atol=2e-4)


def test_wham_without_vertices_needs_the_model(person, read, smpl_file, tmp_path):
    record = layouts.wham_record(person)
    record.pop("verts")
    path = layouts.write_wham(tmp_path / "wham_output.pkl", {0: record})
    estimate = read(path, body_model=smpl_file)
    assert np.allclose(estimate.vertices, person.vertices, atol=2e-4)
    with pytest.raises(InputError, match=r"WHAM.*--body-model"):
        read(path)


def test_phalps_ghosts_are_left_out(person, read, smpl_file, tmp_path):
    frames = layouts.phalp_frames({3: person}, ghosts={2: 3})
    path = layouts.write_people(tmp_path / "demo.pkl", frames, compress=3)
    estimate = read(path, body_model=smpl_file)
    assert estimate.frame_indices.tolist() == [1, 2, 4]
    placed = estimate.vertices + estimate.first_translations[:, None]
    assert np.allclose(placed, person.vertices[[0, 1, 3]], atol=2e-4)
    assert said(estimate, "1 entries that PHALP only predicted")


def test_phalps_people_are_told_by_tid_where_others_are_ghosts(
    person, read, smpl, smpl_file, tmp_path
):
    other = Person.of(smpl, seed=1)
    # tracked_ids has no ghosts, so that its places are not those of the other lists.
    frames = layouts.phalp_frames({3: person, 5: other}, ghosts={1: 3})
    path = layouts.write_people(tmp_path / "demo.pkl", frames, compress=3)
    estimate = read(path, body_model=smpl_file, person=5)
    placed = estimate.vertices + estimate.first_translations[:, None]
    assert np.allclose(placed, other.vertices, atol=2e-4)


def test_phalps_frames_are_numbered_from_the_first_with_or_without_time(
    person, read, smpl_file, tmp_path
):
    frames = layouts.phalp_frames({3: person})
    timed = layouts.write_people(tmp_path / "a.pkl", frames, compress=3)
    for frame in frames.values():
        frame.pop("time")
    named = layouts.write_people(tmp_path / "b.pkl", frames, compress=3)
    for path in (timed, named):
        assert read(path, body_model=smpl_file).frame_indices.tolist() == [1, 2, 3, 4]


def test_phalps_long_focal_length_scales_with_the_picture(person, read, smpl_file, tmp_path):
    frames = layouts.phalp_frames({3: person})
    for frame in frames.values():
        frame["size"] = [[240, 320] for _ in frame["size"]]
    path = layouts.write_people(tmp_path / "a.pkl", frames, compress=3)
    estimate = read(path, body_model=smpl_file)
    placed = estimate.vertices + estimate.first_translations[:, None]
    assert np.allclose(placed, person.vertices, atol=2e-4)


def test_phalp_lists_of_different_length_are_refused(person, read, smpl_file, tmp_path):
    frames = layouts.phalp_frames({3: person})
    frames["outputs/_DEMO/v/img/000003.jpg"]["camera"].append(np.zeros(3))
    path = layouts.write_people(tmp_path / "a.pkl", frames)
    with pytest.raises(InputError, match=r"2 for 1 in .*000003\.jpg"):
        read(path, body_model=smpl_file)


def test_phalp_needs_the_model(person, read, tmp_path):
    path = layouts.write_people(tmp_path / "a.pkl", layouts.phalp_frames({3: person}))
    with pytest.raises(InputError, match=r"PHALP stores pose and shape.*SMPL.*--body-model"):
        read(path)


def test_phalps_boxes_are_told_from_its_results(read, tmp_path):
    boxes = {"gt_bbox": np.zeros((5, 4), np.float32), "extra_data": {"gt_class": []}}
    frames = {f"{number:06d}.jpg": boxes for number in range(1, 4)}
    path = layouts.write_people(tmp_path / "gt_tracks.pkl", frames, compress=3)
    with pytest.raises(InputError, match=r"gt_bbox.*PHALP reads and does not write"):
        read(path)


def test_gvhmr_needs_smplx_and_says_so(smplx, smpl_file, read, tmp_path):
    path = layouts.write_gvhmr(tmp_path / "hmr4d_results.pt", Person.of(smplx))
    with pytest.raises(InputError, match=r"SMPL-X.*smpl-x\.is\.tue\.mpg\.de.*--body-model"):
        read(path)
    with pytest.raises(InputError, match=r"SMPL-X body model, which has 55 joints, got .* 24"):
        read(path, body_model=smpl_file)


def test_smplx_is_no_model_for_smpl_tools(person, smplx_file, read, tmp_path):
    path = layouts.write_people(tmp_path / "a.pkl", layouts.phalp_frames({3: person}))
    with pytest.raises(InputError, match="24 joints, got a model with 55"):
        read(path, body_model=smplx_file)


def test_gvhmrs_focal_length_is_the_stored_one(smplx, smplx_file, read, tmp_path):
    person = Person.of(smplx)
    person.pose[:, 22:] = 0
    path = layouts.write_gvhmr(tmp_path / "hmr4d_results.pt", person, focal_px=1500.0)
    estimate = read(path, body_model=smplx_file)
    assert np.allclose(estimate.vertices, person.vertices, atol=2e-4)


def test_trams_tracks_have_their_camera_in_the_folder(person, smpl, read, smpl_file, tmp_path):
    other = Person.of(smpl, frames=3, seed=1)
    path = layouts.write_tram(tmp_path / "v", [person, other])
    estimate = read(path, body_model=smpl_file)
    assert np.allclose(estimate.vertices, person.vertices, atol=2e-4)
    assert said(estimate, "person 0 (4 frames), person 1 (3 frames)")
    second = read(path, body_model=smpl_file, person=1)
    assert np.allclose(second.vertices, other.vertices, atol=2e-4)


def test_a_lone_track_of_tram_says_that_its_focal_length_is_elsewhere(
    person, read, smpl_file, tmp_path
):
    path = layouts.write_tram_track(tmp_path / "hps_track_0.npy", person, frames=[2, 3, 7, 8])
    estimate = read(path, body_model=smpl_file)
    assert said(estimate, "camera.npy")
    assert estimate.frame_indices.tolist() == [2, 3, 7, 8]
    told = read(path, body_model=smpl_file, focal_px=700)
    assert np.allclose(told.vertices, person.vertices, atol=2e-4)


def test_a_camera_that_tram_saw_move_is_told(person, read, smpl_file, tmp_path):
    still = layouts.write_tram(tmp_path / "still", [person])
    assert not said(read(still, body_model=smpl_file), "camera turn")
    moving = layouts.write_tram(tmp_path / "moving", [person], turned_deg=20)
    assert said(read(moving, body_model=smpl_file), "camera turn by 20.0 degrees")


def test_trams_camera_alone_is_no_estimate(person, read, tmp_path):
    folder = layouts.write_tram(tmp_path / "v", [person])
    with pytest.raises(InputError, match=r"TRAM's camera: give its folder"):
        read(folder / "camera.npy")
