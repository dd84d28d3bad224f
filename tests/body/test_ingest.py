"""Mesh files: how they reach world metres, and what is refused with one line."""

from __future__ import annotations

import zipfile
from dataclasses import replace

import numpy as np
import pytest

from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.estimators.ingest import ingest_meshes
from mocoflow_core.body.mesh_sequence import MeshSequence
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.errors import InputError
from tests.capsule_person import default_recipe, edit_description, write_scene

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


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "an empty file"),
        (b"PK broken", "no .npz archive"),
        (b"\x93NUMPY", "no .npz archive"),
        (b"\x80\x04 or anything else", "no .npz archive"),
    ],
)
def test_a_file_that_is_no_archive_is_refused_in_words_of_our_own(folder, content, what):
    (folder / "meshes.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"meshes\.npz .* vertices, faces and") as refused:
        ingest_meshes(open_scene(folder))
    assert what in refused.value.got
    assert "pickle" not in str(refused.value)


def test_a_single_array_is_no_archive(folder):
    with (folder / "meshes.npz").open("wb") as file:
        np.save(file, MESHES.vertices)
    with pytest.raises(InputError, match=r"no \.npz archive"):
        ingest_meshes(open_scene(folder))


def test_an_archive_of_something_else_is_refused(folder):
    with zipfile.ZipFile(folder / "meshes.npz", "w") as archive:
        for name in ("vertices", "faces", "frame_indices"):
            archive.writestr(f"{name}.npy", b"no array")
    with pytest.raises(InputError, match="got no faces, frame_indices, vertices"):
        ingest_meshes(open_scene(folder))


def test_pickled_objects_are_never_loaded(folder):
    np.savez(folder / "meshes.npz", vertices=np.array([{"a": 1}], object), faces=1, frame_indices=1)
    with pytest.raises(InputError, match=r"plain arrays, got an archive with .* Python objects"):
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
