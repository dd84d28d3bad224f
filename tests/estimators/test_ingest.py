"""Mesh files: how they reach world metres, and what is refused with one line."""

from __future__ import annotations

import zipfile
from dataclasses import replace

import numpy as np
import pytest
from trimesh import Trimesh

from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.estimators.ingest import ingest_meshes
from tests.capsule_person import default_recipe, edit_description, write_scene
from tests.estimators.layouts import write_people, write_wham

MESHES = default_recipe().meshes


@pytest.fixture
def folder(tmp_path):
    return write_scene(tmp_path, default_recipe())


def ingested(folder, meshes: MeshSequence = MESHES, **described) -> IngestedMeshes:
    meshes.save(folder / "meshes.npz")
    edit_description(folder, lambda d: d["meshes"].update(described))
    return ingest_meshes(open_scene(folder))


def refusal(folder, meshes: MeshSequence, **described) -> str:
    with pytest.raises(InputError) as refused:
        ingested(folder, meshes, **described)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def changed(vertices=None, **fields) -> MeshSequence:
    fields = fields if vertices is None else {"vertices": vertices, **fields}
    return replace(MESHES, **fields)


def rows(kept) -> MeshSequence:
    return changed(MESHES.vertices[kept], frame_indices=MESHES.frame_indices[kept])


def test_world_meshes_stay_where_they_are(folder):
    result = ingested(folder)
    assert np.array_equal(result.meshes.vertices, MESHES.vertices)
    assert (result.coordinates, result.located, result.warnings) == ("world", True, ())


def test_meshes_for_another_camera_are_said_to_be_or_refused_in_its_axes(folder, tmp_path):
    [warning] = ingest_meshes(open_scene(folder, "cam01")).warnings
    assert "given for cam00" in warning
    own = tmp_path / "own.npz"
    MESHES.save(own)
    assert ingest_meshes(open_scene(folder, "cam01"), own).warnings == ()
    for coordinates in ("camera", "camera-root-centred"):
        edit_description(folder, lambda d, c=coordinates: d["meshes"].update(coordinates=c))
        with pytest.raises(InputError, match="axes of cam00"):
            ingest_meshes(open_scene(folder, "cam01"))


def test_camera_meshes_are_brought_to_the_world(folder):
    camera = default_recipe().cameras["cam00"]
    in_camera = camera.to_camera(MESHES.vertices.astype(float)).astype(np.float32)
    result = ingested(folder, changed(in_camera), coordinates="camera")
    assert result.coordinates == "world"
    assert np.allclose(result.meshes.vertices, MESHES.vertices, atol=1e-5)


def test_root_centred_meshes_wait_for_the_location_search(folder):
    result = ingested(folder, coordinates="camera-root-centred", located=True)
    assert (result.coordinates, result.located) == ("camera-root-centred", False)


def test_an_override_may_say_its_own_coordinates(folder, tmp_path):
    path = tmp_path / "mine.npz"
    np.savez(
        path,
        vertices=MESHES.vertices,
        faces=MESHES.faces,
        frame_indices=MESHES.frame_indices,
        coordinates="camera-root-centred",
    )
    assert ingest_meshes(open_scene(folder), path).coordinates == "camera-root-centred"


def test_frames_in_any_order_are_sorted(folder):
    order = np.array([3, 0, 5, 1, 4, 2])
    assert np.array_equal(ingested(folder, rows(order)).meshes.vertices, MESHES.vertices)


def test_a_short_gap_is_bridged_with_a_warning(folder):
    result = ingested(folder, rows([0, 1, 3, 4, 5]))
    middle = (MESHES.vertices[1] + MESHES.vertices[3]) / 2
    assert np.allclose(result.meshes.vertices[2], middle, atol=1e-6)
    assert "1 frames without a mesh, the first 2" in result.warnings[0]


@pytest.mark.parametrize("kept", [[0, 5], [0, 1, 2, 3, 4], [1, 2, 3, 4, 5]])
def test_a_long_gap_or_another_frame_count_is_refused(folder, kept):
    assert f"{len(kept)} meshes for 6 frames" in refusal(folder, rows(kept))


def test_meshes_of_frames_that_do_not_exist_are_refused(folder):
    indices = MESHES.frame_indices + 1
    assert "frame 6 that the video does not have" in refusal(folder, changed(frame_indices=indices))


def test_a_frame_that_comes_twice_is_refused(folder):
    indices = np.array([0, 1, 2, 2, 4, 5], np.int32)
    assert "twice" in refusal(folder, changed(frame_indices=indices))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_vertices_are_refused_by_place(folder, value):
    vertices = MESHES.vertices.copy()
    vertices[3, 17] = value
    assert "frame 3, vertex 17" in refusal(folder, changed(vertices))


@pytest.mark.parametrize(
    ("factor", "unit"), [(1000, "millimetres"), (100, "centimetres"), (0.001, "kilometres")]
)
def test_another_unit_is_refused_and_named(folder, factor, unit):
    assert unit in refusal(folder, changed(MESHES.vertices * np.float32(factor)))


def test_a_body_behind_the_camera_is_refused(folder):
    behind = MESHES.vertices - np.float32([0, 20, 0])
    assert "in front of cam00" in refusal(folder, changed(behind))


def test_an_absurdly_far_body_names_the_units(folder):
    far = MESHES.vertices + np.float32([0, 3000, 0])
    assert "unit of t" in refusal(folder, changed(far))


def test_faces_that_name_no_vertex_are_refused(folder):
    faces = MESHES.faces.copy()
    faces[0, 0] = 10**6
    assert "faces must name" in refusal(folder, changed(faces=faces))


def test_degenerate_faces_are_left_out_with_a_warning(folder):
    faces = np.vstack([MESHES.faces, [[4, 4, 5]]]).astype(np.int32)
    result = ingested(folder, changed(faces=faces))
    assert np.array_equal(result.meshes.faces, MESHES.faces)
    assert "1 faces" in result.warnings[0]


def test_no_mesh_at_all_is_refused(folder):
    edit_description(folder, lambda d: d.pop("meshes"))
    with pytest.raises(InputError, match="--meshes"):
        ingest_meshes(open_scene(folder))


@pytest.mark.parametrize("content", [b"", b"PK broken", b"\x93NUMPY", b"\x80\x04 or anything else"])
def test_a_file_that_is_no_archive_is_refused_by_its_name(folder, content):
    (folder / "meshes.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"meshes\.npz must be"):
        ingest_meshes(open_scene(folder))


def test_a_single_array_is_no_estimate(folder):
    with (folder / "meshes.npz").open("wb") as file:
        np.save(file, MESHES.vertices)
    with pytest.raises(InputError, match=r"one of the kinds .*got a ndarray in meshes\.npz"):
        ingest_meshes(open_scene(folder))


def test_an_archive_of_something_else_is_refused(folder):
    with zipfile.ZipFile(folder / "meshes.npz", "w") as archive:
        for name in ("vertices", "faces", "frame_indices"):
            archive.writestr(f"{name}.npy", b"no array")
    with pytest.raises(InputError, match=r"meshes\.npz must be a complete, undamaged file"):
        ingest_meshes(open_scene(folder))


def test_objects_are_no_vertices(folder):
    np.savez(folder / "meshes.npz", vertices=np.array([{"a": 1}], object), faces=1, frame_indices=1)
    with pytest.raises(InputError, match=r"must hold vertices, faces .*got no vertices"):
        ingest_meshes(open_scene(folder))


def test_ingested_meshes_survive_saving(folder, tmp_path):
    before = ingested(folder, rows([0, 1, 3, 4, 5]))
    (tmp_path / "saved").mkdir()
    before.save(tmp_path / "saved")
    after = IngestedMeshes.load(tmp_path / "saved")
    assert np.array_equal(after.meshes.vertices, before.meshes.vertices)
    assert (after.coordinates, after.located, after.warnings) == (
        before.coordinates,
        before.located,
        before.warnings,
    )


def test_first_translations_survive_saving(folder, tmp_path):
    first = np.arange(3.0 * len(MESHES.vertices)).reshape(-1, 3)
    first[1] = np.nan
    (tmp_path / "saved").mkdir()
    replace(ingested(folder), first_translations=first).save(tmp_path / "saved")
    loaded = IngestedMeshes.load(tmp_path / "saved")
    assert np.array_equal(loaded.first_translations, first, equal_nan=True)


def weak_vibe(frames, camera) -> tuple[dict, np.ndarray]:
    """The scene's bodies as VIBE stores them, of these frames, and their weak translations."""
    in_camera = camera.to_camera(MESHES.vertices[frames].astype(float))
    middles = in_camera.mean(axis=1)
    scale_px = camera.K[0, 0] / middles[:, 2]
    side = np.full(len(frames), 80.0)
    centre = camera.project(camera.to_world(middles))
    cam = np.column_stack([2 * scale_px / (1.1 * side), np.zeros((len(frames), 2))])
    verts = (in_camera - middles[:, None]).astype(np.float32)
    boxes = np.column_stack([centre, side, side])
    record = {"pred_cam": cam, "bboxes": boxes, "verts": verts, "frame_ids": np.array(frames)}
    return record, middles


@pytest.fixture
def faces(tmp_path):
    MESHES.save(tmp_path / "faces.npz")
    return EstimateConfig(faces=tmp_path / "faces.npz")


def test_an_estimators_file_is_placed_in_the_scene_and_its_gap_is_bridged(folder, tmp_path, faces):
    camera = default_recipe().cameras["cam00"]
    record, places = weak_vibe([0, 1, 3, 4, 5], camera)
    path = write_people(tmp_path / "vibe_output.pkl", {1: record})
    result = ingest_meshes(open_scene(folder), path, faces)
    assert (result.coordinates, result.located) == ("camera-root-centred", False)
    assert result.meshes.frame_indices.tolist() == [0, 1, 2, 3, 4, 5]
    known = np.delete(result.first_translations, 2, axis=0)
    assert np.allclose(known, places, atol=1e-5)
    assert np.allclose(result.first_translations[2], (places[1] + places[2]) / 2, atol=1e-5)
    assert any("1 frames without a mesh" in warning for warning in result.warnings)


def test_an_estimate_in_the_cameras_axes_is_brought_to_the_world(folder, tmp_path, faces):
    scene = open_scene(folder)
    camera = scene.cameras["cam00"]
    verts = camera.to_camera(MESHES.vertices.astype(float)).astype(np.float32)
    record = {"verts_cam": verts, "frame_id": np.arange(6), "trans_world": np.zeros((6, 3))}
    path = write_wham(tmp_path / "wham_output.pkl", {0: record})
    chosen = faces.model_copy(update={"focal_px": float(camera.K[0, 0])})
    result = ingest_meshes(scene, path, chosen)
    assert (result.coordinates, result.located) == ("world", False)
    assert np.allclose(result.meshes.vertices, MESHES.vertices, atol=1e-5)


def test_positions_count_from_the_first_frame_of_the_video(folder, tmp_path, faces):
    for kind in ("frames", "masks"):
        for camera in ("cam00", "cam01"):
            where = folder / kind / camera
            for number in reversed(range(6)):
                (where / f"{number:06d}.png").rename(where / f"{number + 30:06d}.png")
    record, _ = weak_vibe(list(range(6)), default_recipe().cameras["cam00"])
    path = write_people(tmp_path / "vibe_output.pkl", {1: record})
    result = ingest_meshes(open_scene(folder), path, faces)
    assert result.meshes.frame_indices.tolist() == [30, 31, 32, 33, 34, 35]


def cut_out_of_a_longer_source(folder, first: int, begins_at: int) -> None:
    """The six frames are now ``first`` to ``first + 5`` of a source whose first one is given."""
    for kind in ("frames", "masks"):
        for camera in ("cam00", "cam01"):
            where = folder / kind / camera
            for number in reversed(range(6)):
                (where / f"{number:06d}.png").rename(where / f"{number + first:06d}.png")
    edit_description(folder, lambda d: d.update(source_begins_at=begins_at))


@pytest.mark.parametrize(("first", "begins_at"), [(0, 0), (10, 0), (4, 1)])
def test_an_estimate_of_the_whole_source_is_cut_to_the_clip(
    folder, tmp_path, faces, first, begins_at
):
    cut_out_of_a_longer_source(folder, first, begins_at)
    before, after = first - begins_at, 7
    shown = [0] * before + [*range(6)] + [5] * after
    record, places = weak_vibe(shown, default_recipe().cameras["cam00"])
    record["verts"][before + 6 :] = np.nan  # Nothing outside the clip matters.
    record["frame_ids"] = np.arange(len(shown))
    path = write_people(tmp_path / "vibe_output.pkl", {1: record})
    result = ingest_meshes(open_scene(folder), path, faces)
    assert result.meshes.frame_indices.tolist() == list(range(first, first + 6))
    assert np.allclose(result.first_translations, places[before : before + 6], atol=1e-5)
    [remark] = [said for said in result.warnings if "of the source" in said]
    assert f"those of the clip, {first} to {first + 5}, are used" in remark


def test_an_estimate_of_the_clip_alone_is_refused_until_its_place_is_told(folder, tmp_path, faces):
    cut_out_of_a_longer_source(folder, 4, 0)
    record, _ = weak_vibe(list(range(6)), default_recipe().cameras["cam00"])
    path = write_people(tmp_path / "vibe_output.pkl", {1: record})
    with pytest.raises(InputError, match=r"meshes\.first_frame"):
        ingest_meshes(open_scene(folder), path, faces)
    placed = faces.model_copy(update={"first_frame": 4})
    result = ingest_meshes(open_scene(folder), path, placed)
    assert result.meshes.frame_indices.tolist() == list(range(4, 10))


def test_an_estimate_of_another_part_of_the_source_is_refused(folder, tmp_path, faces):
    cut_out_of_a_longer_source(folder, 40, 0)
    record, _ = weak_vibe(list(range(6)), default_recipe().cameras["cam00"])
    path = write_people(tmp_path / "vibe_output.pkl", {1: record})
    with pytest.raises(InputError, match=r"clip's frames 40 to 45.*frames 0 to 5.*first_frame"):
        ingest_meshes(open_scene(folder), path, faces)


@pytest.mark.parametrize("frames", [range(5), range(7)])
def test_an_estimate_of_another_number_of_frames_is_refused(folder, tmp_path, faces, frames):
    rows = [min(frame, 5) for frame in frames]
    record, _ = weak_vibe(rows, default_recipe().cameras["cam00"])
    record["frame_ids"] = np.array(frames)
    path = write_people(tmp_path / "vibe_output.pkl", {1: record})
    with pytest.raises(InputError, match=f"{len(rows)} meshes for 6 frames"):
        ingest_meshes(open_scene(folder), path, faces)


def test_a_scene_may_name_an_estimators_file_itself(folder, tmp_path, faces):
    record, _ = weak_vibe(list(range(6)), default_recipe().cameras["cam00"])
    write_people(folder / "vibe_output.pkl", {1: record})
    edit_description(folder, lambda d: d["meshes"].update(file="vibe_output.pkl"))
    assert ingest_meshes(open_scene(folder), None, faces).coordinates == "camera-root-centred"


def test_a_folder_of_meshes_stands_where_the_scene_says(folder, tmp_path):
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    for number, body in zip(MESHES.frame_indices, MESHES.vertices, strict=True):
        Trimesh(body, MESHES.faces, process=False).export(meshes / f"{number}.ply")
    result = ingest_meshes(open_scene(folder), meshes)
    assert (result.coordinates, result.located) == ("world", True)
    assert np.array_equal(result.meshes.vertices, MESHES.vertices)
    assert "the world" in result.warnings[0]
