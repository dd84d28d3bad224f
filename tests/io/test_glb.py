"""Animated GLB files, read back as the format says."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
import trimesh

from mocoflow_core.io.glb import AnimatedMesh, write_glb

COUNTS = {"SCALAR": 1, "VEC3": 3}
DTYPES = {5126: np.float32, 5125: np.uint32}
BOX = trimesh.creation.box((0.2, 0.4, 1.8))
TIMES_S = np.array([0.0, 0.1, 0.4])


@pytest.fixture
def mesh():
    rng = np.random.default_rng(0)
    vertices = np.asarray(BOX.vertices)
    return AnimatedMesh(
        name="box",
        vertices=vertices,
        faces=np.asarray(BOX.faces, np.int32),
        colours=rng.random((len(vertices), 3)).astype(np.float32),
        poses=np.stack([vertices + np.array([k, 0, 0]) for k in range(3)]).astype(np.float32),
        pose_names=("frame 4", "frame 5", "frame 8"),
        times_s=TIMES_S,
    )


@pytest.fixture
def path(mesh, tmp_path):
    write_glb(tmp_path / "box.glb", mesh, up=(0, 0, 1))
    return tmp_path / "box.glb"


def chunks(path):
    """The document and the binary chunk, with every length checked."""
    content = path.read_bytes()
    magic, version, total = struct.unpack_from("<4sII", content)
    assert (magic, version, total) == (b"glTF", 2, len(content))
    length, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON"
    document = json.loads(content[20 : 20 + length])
    rest = content[20 + length :]
    size, kind = struct.unpack_from("<I4s", rest)
    assert kind == b"BIN\0"
    assert size == len(rest) - 8 == document["buffers"][0]["byteLength"]
    assert length % 4 == size % 4 == 0
    return document, rest[8:]


def values(document, binary, number):
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    dtype, columns = DTYPES[accessor["componentType"]], COUNTS[accessor["type"]]
    start, count = view["byteOffset"], accessor["count"] * columns
    assert start % 4 == 0
    assert view["byteLength"] == 4 * count
    return np.frombuffer(binary, dtype, count, start).reshape(accessor["count"], columns)


def test_all_accessors_lie_side_by_side_and_state_their_true_bounds(path):
    document, binary = chunks(path)
    end = 0
    for view in document["bufferViews"]:
        assert view["byteOffset"] == end
        end += view["byteLength"]
    assert end == len(binary)
    for number, accessor in enumerate(document["accessors"]):
        if "min" in accessor:
            found = values(document, binary, number)
            assert accessor["min"] == found.min(0).tolist()
            assert accessor["max"] == found.max(0).tolist()


def test_what_the_format_wants_bounded_is_bounded(path):
    document, _ = chunks(path)
    (primitive,) = document["meshes"][0]["primitives"]
    bounded = [
        primitive["attributes"]["POSITION"],
        document["animations"][0]["samplers"][0]["input"],
    ]
    bounded += [target["POSITION"] for target in primitive["targets"]]
    assert all({"min", "max"} <= set(document["accessors"][number]) for number in bounded)


def test_the_animation_is_in_seconds_and_shows_one_pose_at_each_time(path, mesh):
    document, binary = chunks(path)
    (animation,) = document["animations"]
    (sampler,), (channel,) = animation["samplers"], animation["channels"]
    assert channel == {"sampler": 0, "target": {"node": 0, "path": "weights"}}
    times = values(document, binary, sampler["input"])[:, 0]
    assert times == pytest.approx(TIMES_S)
    weights = values(document, binary, sampler["output"]).reshape(len(times), -1)
    (primitive,) = document["meshes"][0]["primitives"]
    base = values(document, binary, primitive["attributes"]["POSITION"])
    moves = [values(document, binary, target["POSITION"]) for target in primitive["targets"]]
    shown = base + np.einsum("tp,pvk->tvk", weights, moves)
    assert shown == pytest.approx(mesh.poses, abs=1e-6)
    assert len(document["meshes"][0]["extras"]["targetNames"]) == len(moves)


def test_another_program_sees_the_base_mesh_with_its_colours_in_linear_light(path, mesh):
    (found,) = trimesh.load(path, process=False).geometry.values()
    assert found.vertices == pytest.approx(mesh.vertices, abs=1e-6)
    assert np.array_equal(found.faces, mesh.faces)
    # sRGB's curve, but for its straight start.
    linear, bright = ((mesh.colours + 0.055) / 1.055) ** 2.4, mesh.colours > 0.05
    stored = np.asarray(found.visual.vertex_attributes["color"])
    assert stored[bright] == pytest.approx(linear[bright], abs=1e-5)
    assert (stored[~bright] <= mesh.colours[~bright] / 12).all()


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1, -1])
def test_whatever_is_up_stands_upright(mesh, tmp_path, axis, sign):
    up = sign * np.eye(3)[axis]
    write_glb(tmp_path / "up.glb", mesh, up)
    scene = trimesh.load(tmp_path / "up.glb", process=False)
    (node,) = scene.graph.nodes_geometry
    turn, _ = scene.graph[node]
    assert turn[:3, :3] @ up == pytest.approx([0, 1, 0], abs=1e-6)
    assert np.linalg.det(turn[:3, :3]) == pytest.approx(1.0)
