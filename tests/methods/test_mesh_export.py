"""A trained toy scene as meshes, of either representation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import torch
import trimesh

from mocoflow_core.errors import InputError
from mocoflow_core.io.run_folder import RunRecord
from mocoflow_core.methods.mesh_export import MeshRequest, carried, export_meshes
from mocoflow_core.methods.surface_mesh import surface_mesh
from mocoflow_core.rendering.surface_points import surface_points
from mocoflow_core.rendering.trained_scene import TrainedScene
from tests.one_thread import one_thread  # noqa: F401
from tests.toy_training import SAMPLING, prepare, silent, train, write_toy

SPACING_M = 0.03


@dataclass(frozen=True)
class Toy:
    run: RunRecord
    folder: object
    clip: object


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    prepared = prepare(write_toy(tmp_path_factory.mktemp("scene") / "toy"))
    folder = tmp_path_factory.mktemp("trained")
    train(prepared, folder)
    clip = prepared.clip
    capture = {"fps": clip.fps, "source_fps": clip.fps, "up": [0, 0, 1]}
    capture |= {"first_frame": 0, "last_frame": int(clip.frame_indices[-1])}
    said = {"request": "", "scene": "toy", "scene_path": "", "preset": "toy", "store": ""}
    return Toy(RunRecord(**said, seed=0, configuration={}, capture=capture), folder, clip)


def canonical_of(scene):
    return scene.space.canonical(scene.field)


def export(toy, out, **request):
    request = {"spacing_m": SPACING_M} | request
    return export_meshes(toy.run, toy.folder, MeshRequest(**request), out, silent)


def test_one_ply_for_every_frame_and_one_for_none(toy, tmp_path):
    mesh = export(toy, tmp_path / "plys", format="ply", frames=(4, 0))
    assert {path.name for path in (tmp_path / "plys").iterdir()} == {
        "canonical.ply",
        "000000.ply",
        "000004.ply",
    }
    canonical = trimesh.load(tmp_path / "plys" / "canonical.ply", process=False)
    assert canonical.vertices == pytest.approx(mesh.vertices, abs=1e-6)
    stored = canonical.visual.vertex_colors[:, :3] / 255.0
    assert np.abs(stored - mesh.colours).max() < 1 / 255
    for frame in (0, 4):
        posed = trimesh.load(tmp_path / "plys" / f"{frame:06d}.ply", process=False)
        assert np.array_equal(posed.faces, mesh.faces)


def test_the_exported_body_is_closed_and_winds_outward(toy, tmp_path):
    mesh = export(toy, tmp_path / "plys", format="ply", frames=(0,))
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.volume > 0.05  # Five capsules.


def test_posed_meshes_lie_where_the_camera_sees_the_surface(toy, tmp_path):
    export(toy, tmp_path / "plys", format="ply", spacing_m=0.02)
    scene = TrainedScene.open(toy.folder)
    for frame, time in zip(toy.clip.frame_indices, toy.clip.times, strict=True):
        posed = trimesh.load(tmp_path / "plys" / f"{frame:06d}.ply", process=False)
        seen = surface_points(scene, toy.clip.camera, float(time)).points
        _, distance, _ = trimesh.proximity.closest_point(posed, seen)
        # A ray knows its density once in a step.
        assert np.median(distance) < 0.5 * SAMPLING.step_m, frame


def test_an_animation_spans_the_clip_in_seconds(toy, tmp_path):
    export(toy, tmp_path / "toy.glb", format="glb")
    content = (tmp_path / "toy.glb").read_bytes()
    duration_s = toy.clip.frame_indices[-1] / toy.clip.fps
    assert f'"min":[0.0],"max":[{float(np.float32(duration_s))}]'.encode() in content


def test_the_same_scene_gives_the_same_files(toy, tmp_path):
    for name in ("a.glb", "b.glb"):
        export(toy, tmp_path / name, format="glb", frames=(0, 3))
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


@pytest.mark.parametrize(
    ("request_", "name", "because"),
    [
        ({"format": "obj"}, "out", "glb, ply"),
        ({"format": "glb"}, "out", r"ends in \.glb"),
        ({"format": "ply"}, "out.glb", "a folder"),
        ({"format": "ply", "frames": (0, 99)}, "out", "99 as a frame"),
        ({"format": "ply", "spacing_m": 0.001}, "out", "million points"),
    ],
)
def test_what_cannot_be_exported_is_refused_without_a_trace(toy, tmp_path, request_, name, because):
    with pytest.raises(InputError, match=because):
        export(toy, tmp_path / name, **request_)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("wanted", "taken"), [("ply", "out/thesis.txt"), ("glb", "a.glb")])
def test_a_place_that_is_taken_is_left_alone(toy, tmp_path, wanted, taken):
    (tmp_path / taken).parent.mkdir(exist_ok=True)
    (tmp_path / taken).write_text("precious")
    with pytest.raises(InputError, match="new or empty"):
        export(toy, tmp_path / taken.split("/")[0], format=wanted)
    assert (tmp_path / taken).read_text() == "precious"


def test_points_that_the_motion_does_not_know_go_with_their_neighbours(toy):
    posed = TrainedScene.open(toy.folder).at(1.0)
    near = surface_mesh(canonical_of(TrainedScene.open(toy.folder)), SPACING_M).vertices[:50]
    far = near[:1] + np.array([0.0, 0.0, 9.0])
    moved = carried(posed, np.concatenate([near, far]))
    last = np.linalg.norm(near - far, axis=1).argmin()
    assert moved[-1] - far[0] == pytest.approx(moved[last] - near[last], abs=1e-5)


def test_mean_light_is_neither_the_brightest_nor_the_darkest_side(toy):
    scene = TrainedScene.open(toy.folder)
    grid = scene.field.canonical
    grid.light.light = torch.tensor([0.0, 0.0, 0.5])
    grid.light.brightest = 1.5
    points = torch.from_numpy(scene.space.canonical_vertices[:20])
    code = scene.field.appearance.mean(0).expand(20, -1)
    top, below = (grid(points, code, torch.tensor([[0.0, 0, s]]).expand(20, 3))[0] for s in (1, -1))
    lit = canonical_of(scene).colour(points, points)
    assert ((below < lit) & (lit < top)).all()
