"""What goes wrong with VIBE's and PARE's files, and does not here."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mocoflow_core.errors import InputError
from tests.estimators.layouts import Person, pare_record, vibe_record, write_people


@pytest.fixture
def write(tmp_path):
    return lambda *records, **people: write_people(
        tmp_path / "vibe_output.pkl", dict(enumerate(records, 1)) | people
    )


def placed(estimate):
    return estimate.vertices + estimate.first_translations[:, None]


def test_the_crop_factor_is_put_right_from_crop_camera_and_box(write, person, read, faces_file):
    path = write(vibe_record(person))
    assert np.allclose(placed(read(path, faces=faces_file)), person.vertices, atol=2e-4)
    naive = read(path, faces=faces_file, crop_factor=1.0)
    depth = (person.middles + person.translations)[:, 2]
    middles = placed(naive).mean(axis=1)[:, 2]
    assert middles == pytest.approx(1.1 * depth, rel=1e-4)


def test_another_crop_factor_can_be_set(write, person, read, faces_file):
    path = write(vibe_record(person, factor=1.3))
    estimate = read(path, faces=faces_file, crop_factor=1.3)
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)


def test_without_the_crop_camera_the_full_images_camera_gives_the_depth(
    write, person, read, faces_file
):
    record = vibe_record(person)
    for part in ("pred_cam", "bboxes"):
        record.pop(part)
    estimate = read(write(record), faces=faces_file)
    assert np.allclose(placed(estimate)[..., 2], person.vertices[..., 2], atol=2e-4)
    assert np.abs(placed(estimate) - person.vertices).max() < 0.2
    assert any("depth alone" in remark for remark in estimate.remarks)


def test_without_any_camera_bodies_have_no_place(write, person, read, faces_file):
    record = vibe_record(person)
    for part in ("pred_cam", "bboxes"):
        record.pop(part)
    record["orig_cam"] = None
    assert read(write(record), faces=faces_file).first_translations is None


def test_rows_are_positions_and_frames_have_gaps(write, person, read, faces_file):
    estimate = read(write(vibe_record(person, frames=[3, 4, 9, 10])), faces=faces_file)
    assert estimate.frame_indices.tolist() == [3, 4, 9, 10]
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)


def test_all_people_are_kept_apart(write, person, smpl, read, faces_file, tmp_path):
    other = Person.of(smpl, frames=7, seed=1)
    people = {1: vibe_record(person), 7: vibe_record(other)}
    path = write_people(tmp_path / "two.pkl", people)
    longest = read(path, faces=faces_file)
    assert np.allclose(placed(longest), other.vertices, atol=2e-4)
    assert "person 1 (4 frames), person 7 (7 frames)" in longest.remarks[0]
    first = read(path, faces=faces_file, person=1)
    assert np.allclose(placed(first), person.vertices, atol=2e-4)
    with pytest.raises(InputError, match="person 7"):
        read(path, faces=faces_file, person=2)


def test_shapes_that_vary_become_one_with_a_model_and_are_said_to_vary_without(
    write, person, read, smpl_file, faces_file
):
    path = write(vibe_record(person, betas=person.shapes(wobble=0.2)))
    one = read(path, body_model=smpl_file)
    assert np.allclose(
        one.vertices - one.vertices.mean(1, keepdims=True),
        person.bodies - person.bodies.mean(1, keepdims=True),
        atol=2e-5,
    )
    assert any("the median" in remark for remark in one.remarks)
    for chosen in ({"body_model": smpl_file, "shape": "per_frame"}, {"faces": faces_file}):
        own = read(path, **chosen)
        assert not np.allclose(own.vertices, person.bodies, atol=1e-3)
        assert np.allclose(own.vertices[0], person.bodies[0], atol=2e-5)
    assert any("vary" in remark for remark in own.remarks)


def test_a_model_that_gives_other_bodies_is_not_used(write, person, read, smpl_file):
    record = vibe_record(person, betas=person.shapes(wobble=0.2))
    record["verts"] = record["verts"] * np.float32(1.05)
    estimate = read(write(record), body_model=smpl_file)
    assert np.array_equal(estimate.vertices, record["verts"])
    assert any("another gender or version" in remark for remark in estimate.remarks)


def test_faces_are_asked_for_with_what_to_do(write, person, read):
    with pytest.raises(InputError, match=r"no faces.*--body-model.*meshes\.faces") as refused:
        read(write(vibe_record(person)))
    assert "\n" not in str(refused.value)


def test_faces_of_another_topology_are_refused(write, person, read, tmp_path, smpl):
    own = tmp_path / "other.npz"
    np.savez(own, vertices=smpl.template[None, :-1], faces=smpl.faces[:3], frame_indices=[0])
    mesh = tmp_path / "other.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for path in (own, mesh):
        with pytest.raises(InputError, match=f"{len(smpl.template)} vertices"):
            read(write(vibe_record(person)), faces=path)


def test_faces_come_from_any_mesh_of_the_topology(write, person, read, tmp_path, smpl):
    for ending in ("obj", "ply", "glb"):
        path = tmp_path / f"body.{ending}"
        trimesh.Trimesh(smpl.template, smpl.faces, process=False).export(path)
        estimate = read(write(vibe_record(person)), faces=path)
        assert np.array_equal(estimate.faces, smpl.faces)


def test_vertices_may_have_been_left_out_where_a_model_is_given(write, person, read, smpl_file):
    record = vibe_record(person)
    record.pop("verts")
    path = write(record)
    assert np.allclose(placed(read(path, body_model=smpl_file)), person.vertices, atol=2e-4)
    with pytest.raises(InputError, match=r"VIBE.*SMPL.*--body-model"):
        read(path)


def test_boxes_of_pictures_of_another_size_are_scaled(write, person, read, faces_file):
    record = vibe_record(person)
    record["bboxes"] = record["bboxes"] * 3
    estimate = read(write(record), faces=faces_file)
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)
    assert any("1920 px wide" in remark for remark in estimate.remarks)


def test_older_files_without_newer_keys_are_read(write, person, read, faces_file):
    record = vibe_record(person)
    for part in ("joints2d_img_coord", "joints2d", "joints3d"):
        record.pop(part)
    assert np.allclose(placed(read(write(record), faces=faces_file)), person.vertices, atol=2e-4)


def test_pares_network_saw_the_box_as_it_is(write, person, read, faces_file):
    estimate = read(write(pare_record(person)), faces=faces_file)
    assert estimate.source == "PARE"
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)


def test_frames_before_the_tools_first_can_be_told(write, person, read, faces_file):
    estimate = read(write(vibe_record(person)), faces=faces_file, first_frame=100)
    assert estimate.frame_indices.tolist() == [100, 101, 102, 103]


def test_boxes_of_followed_2d_poses_are_said_to_need_a_look(write, person, read, faces_file):
    by_boxes = read(write(vibe_record(person)), faces=faces_file)
    followed = vibe_record(person) | {"joints2d": np.zeros((len(person), 21, 3), np.float32)}
    estimate = read(write(followed), faces=faces_file)
    assert estimate.source == "VIBE"
    assert np.allclose(placed(estimate), person.vertices, atol=2e-4)
    assert any("another routine" in remark for remark in estimate.remarks)
    assert not any("another routine" in remark for remark in by_boxes.remarks)
