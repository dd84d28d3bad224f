"""Meshes as they are stored: no vertex merged, split or dropped, nothing else opened."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from mocoflow_core.body.mesh_faces import read_faces
from mocoflow_core.body.mesh_file import read_mesh
from mocoflow_core.errors import InputError

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


@pytest.mark.parametrize("ending", ["obj", "ply", "off", "glb"])
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


def _glb(tmp_path, change, body=trimesh.creation.box()):  # noqa: B008
    """A mesh as a GLB file whose description was changed, and another file beside it."""
    content = body.export(file_type="glb")
    length = int.from_bytes(content[12:16], "little")
    scene = json.loads(content[20 : 20 + length])
    change(scene)
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    head = content[:12] + len(text).to_bytes(4, "little") + content[16:20]
    path = tmp_path / "a.glb"
    path.write_bytes(head + text + content[20 + length :])
    return path


@pytest.mark.parametrize("read", [read_mesh, lambda path: read_faces(path, 8)])
def test_a_glb_that_names_a_file_beside_it_does_not_get_it(tmp_path, read):
    (tmp_path / "secret.bin").write_bytes(bytes(1000))
    path = _glb(tmp_path, lambda scene: scene["buffers"][0].update(uri="secret.bin"))
    path.write_bytes(path.read_bytes()[: 20 + int.from_bytes(path.read_bytes()[12:16], "little")])
    with pytest.raises(InputError):
        read(path)


def _many_nodes(scene):
    scene["nodes"] = scene["nodes"] * 400
    scene["scenes"][0]["nodes"] = list(range(400))


def _many_meshes(scene):
    scene["meshes"] = scene["meshes"] * 400


def _many_accessors(scene):
    scene["accessors"] += [{"componentType": 5126, "type": "VEC3", "count": 1000}] * 10_000


def _a_long_accessor(scene):
    del scene["accessors"][0]["bufferView"]
    scene["accessors"][0]["count"] = 10**9


@pytest.mark.parametrize("many", [_many_nodes, _many_meshes, _many_accessors, _a_long_accessor])
def test_a_glb_cannot_multiply_its_mesh_without_end(tmp_path, many):
    with pytest.raises(InputError, match="must be one body"):
        read_mesh(_glb(tmp_path, many, trimesh.creation.icosphere(4)))


def test_pictures_in_a_glb_are_not_looked_at(tmp_path):
    def dressed(scene):
        scene["images"] = [{"uri": "data:image/png;base64,AAAA"}]
        scene["textures"] = [{"source": 0}]
        scene["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        scene["meshes"][0]["primitives"][0]["material"] = 0

    assert len(read_mesh(_glb(tmp_path, dressed))[0]) == 8
