"""Faces from a mesh or from a body model, for sources that store vertices only."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.mesh_faces import read_faces
from mocoflow_core.errors import InputError
from tests.small_smpl import write_smpl

CUBE = trimesh.creation.box()


def test_from_a_body_model(tmp_path):
    arrays = write_smpl(tmp_path / "model.pkl", 600)
    assert np.array_equal(read_faces(tmp_path / "model.pkl", 600), arrays["f"])


@pytest.mark.parametrize("ending", ["ply", "off", "glb", "obj"])
def test_from_a_mesh_with_its_vertices_in_their_order(tmp_path, ending):
    CUBE.export(tmp_path / f"mesh.{ending}")
    assert np.array_equal(read_faces(tmp_path / f"mesh.{ending}", 8), CUBE.faces)


def test_texture_seams_in_an_obj_split_no_vertex(tmp_path):
    # Corner 1 has two places in the texture, as along the seams of consensus.obj.
    (tmp_path / "consensus.obj").write_text(
        "# person\nmtllib tex.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
        "vt 0 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/1/1 3/2/1\nf 1/2 3/2 4/1\nf -4 -3 -2 -1\n"
    )
    expected = [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3]]
    faces = read_faces(tmp_path / "consensus.obj", 4)
    assert [np.roll(face, -face.argmin()).tolist() for face in faces] == expected


def test_faces_of_another_body_are_refused(tmp_path):
    CUBE.export(tmp_path / "mesh.ply")
    with pytest.raises(InputError, match="must be a mesh of 6890 vertices, got 8 vertices"):
        read_faces(tmp_path / "mesh.ply", 6890)
    (tmp_path / "bad.obj").write_text("v 0 0 0\nf 1 2 99999999999\n")
    with pytest.raises(InputError, match="cannot be read as one"):
        read_faces(tmp_path / "bad.obj", 1)


@pytest.mark.parametrize("ending", ["ply", "obj", "glb", "stl"])
def test_what_is_no_mesh_is_refused(tmp_path, ending):
    (tmp_path / f"mesh.{ending}").write_bytes(b"f a b c\n\x00\x01")
    with pytest.raises(InputError):
        read_faces(tmp_path / f"mesh.{ending}", 8)


def test_without_any_file_it_is_said_what_would_do(tmp_path):
    with pytest.raises(InputError, match="nor a mesh to take the faces from"):
        read_faces(tmp_path / "none.obj", 6890)
