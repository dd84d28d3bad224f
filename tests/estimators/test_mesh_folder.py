"""Folders of meshes: joined by the numbers in their names, of one topology."""

from __future__ import annotations

import pytest
import trimesh

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.context import EstimateContext
from mocoflow_core.estimators.read import read_estimate
from tests.estimators.layouts import CAMERA


@pytest.fixture
def folder(tmp_path):
    """Boxes of frames 8 to 11, whose names do not sort as their numbers do."""
    folder = tmp_path / "meshes"
    folder.mkdir()
    for number in range(8, 12):
        box = trimesh.creation.box()
        box.apply_translation([0, 0, number])
        box.export(folder / f"frame_{number}.obj")
    return folder


def test_frames_are_told_by_numbers_and_not_by_sorting_names(folder, read):
    estimate = read(folder)
    assert estimate.frame_indices.tolist() == [8, 9, 10, 11]
    assert estimate.vertices.mean(axis=1)[:, 2] == pytest.approx([8, 9, 10, 11])
    assert estimate.numbering == "source"


@pytest.mark.parametrize("coordinates", ["world", "camera", "camera-root-centred"])
def test_where_they_stand_can_be_said(folder, read, coordinates):
    estimate = read(folder, coordinates=coordinates)
    assert estimate.coordinates == coordinates
    assert estimate.located is (coordinates != "camera-root-centred")


def test_each_file_is_told(folder):
    said = []
    read_estimate(folder, EstimateContext(CAMERA, progress=lambda *told: said.append(told)))
    assert [share for share, _ in said] == [1 / 4, 2 / 4, 3 / 4]
    assert {text for _, text in said} < {f"frame_{number}.obj" for number in range(8, 12)}


def test_another_topology_is_refused_by_file(folder, read):
    trimesh.creation.icosphere(1).export(folder / "frame_12.obj")
    with pytest.raises(InputError, match=r"42 vertices and 80 faces in frame_12\.obj"):
        read(folder)


def test_the_same_vertices_with_other_faces_are_refused(folder, read):
    box = trimesh.creation.box()
    box.faces = box.faces[:, ::-1]
    box.export(folder / "frame_12.obj")
    with pytest.raises(InputError, match="same faces"):
        read(folder)


@pytest.mark.parametrize("name", ["body.obj", "pose_08.obj"])
def test_names_without_a_number_of_their_own_are_refused(folder, read, name):
    trimesh.creation.box().export(folder / name)
    with pytest.raises(InputError, match=name):
        read(folder)


def test_a_link_out_of_the_folder_is_refused(folder, read, tmp_path):
    trimesh.creation.box().export(tmp_path / "outside.obj")
    (folder / "frame_12.obj").symlink_to(tmp_path / "outside.obj")
    with pytest.raises(InputError, match=r"frame_12\.obj, a link"):
        read(folder)


def test_a_single_mesh_is_not_a_sequence(folder, read):
    with pytest.raises(InputError, match="Name the folder"):
        read(folder / "frame_8.obj", kind="mesh_folder")
