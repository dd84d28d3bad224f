"""Meshes as they are stored: no vertex merged, split or dropped, nothing else opened."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mocoflow_core.errors import InputError
from mocoflow_core.estimators.mesh_file import read_mesh

SEAM = """mtllib ../../outside.mtl
usemtl skin
v 0 0 0
v 9 9 9
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 1
vn 0 0 1
f 1/1/1 3/2/1 4/1/1 5/2/1
f -5/2 -3/1 -2/1
"""


def test_texture_seams_and_unused_vertices_keep_the_vertices_of_an_obj(tmp_path):
    (tmp_path / "a.obj").write_text(SEAM)
    vertices, faces = read_mesh(tmp_path / "a.obj")
    assert vertices.tolist() == [[0, 0, 0], [9, 9, 9], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert sorted(map(sorted, faces.tolist())) == [[0, 2, 3], [0, 2, 3], [0, 3, 4]]


@pytest.mark.parametrize("ending", ["obj", "ply", "glb"])
def test_every_format_keeps_vertices_and_faces_in_order(tmp_path, ending):
    body = trimesh.creation.icosphere(2)
    body.export(tmp_path / f"a.{ending}")
    vertices, faces = read_mesh(tmp_path / f"a.{ending}")
    assert np.allclose(vertices, body.vertices, atol=1e-6)
    assert np.array_equal(faces, body.faces)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.obj", b"nonsense"),
        ("a.obj", b"v 0 0 0\nf 1 2 900\n"),
        ("a.obj", b""),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 3"),
        ("a.glb", b"glTF"),
        ("a.stl", b"solid"),
    ],
)
def test_what_is_no_mesh_is_refused_with_one_line(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as refused:
        read_mesh(tmp_path / name)
    assert "\n" not in str(refused.value)


def test_a_glb_whose_data_lie_outside_is_refused(tmp_path):
    body = trimesh.creation.box()
    for name, content in trimesh.exchange.gltf.export_gltf(body.scene()).items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "model.gltf").rename(tmp_path / "model.glb")
    with pytest.raises(InputError):
        read_mesh(tmp_path / "model.glb")
