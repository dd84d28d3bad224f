"""The layout of People-Snapshot, written and read: what was filmed comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from trimesh import Trimesh
from trimesh.exchange.obj import export_obj

from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.extract import CaptureConfig, extract_clip
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.datasets.dataset_checks import check_dataset
from mocoflow_core.datasets.people_snapshot import PeopleSnapshotConfig, read_people_snapshot
from mocoflow_core.datasets.write_dataset import write_dataset
from mocoflow_core.errors import InputError
from mocoflow_core.estimators.configuration import EstimateConfig
from mocoflow_core.estimators.ingest import ingest_meshes
from tests.datasets.snapshot_layout import turning, write_snapshot
from tests.estimators.layouts import write_people
from tests.lossless_video import write_lossless
from tests.small_smpl import write_smpl

FRAMES, SIDE = 12, 96


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    write_smpl(folder / "basicModel_f_lbs_10_207_0_v1.0.0.pkl")
    return folder


@pytest.fixture(scope="module")
def recording(models):
    return turning(FRAMES, SIDE, next(models.iterdir()))


@pytest.fixture(scope="module")
def scene(models, recording, tmp_path_factory):
    """Read by the defaults, of one pose more than frames, which is the first."""
    folder = tmp_path_factory.mktemp("snapshot") / "female-9-casual"
    write_snapshot(folder, replace(recording, surplus="start", keypoints=True))
    return read_people_snapshot(folder, PeopleSnapshotConfig(body_model=models))


@pytest.fixture
def write(tmp_path, recording):
    """Writes the layout with parts of the recording changed."""

    def written(**changes):
        return write_snapshot(tmp_path / "female-9-casual", replace(recording, **changes))

    return written


def refusal(folder, **choices) -> str:
    with pytest.raises(InputError) as refused:
        read_people_snapshot(folder, PeopleSnapshotConfig(**choices))
    assert "\n" not in str(refused.value)
    return str(refused.value)


def remarks(scene) -> str:
    return " | ".join(scene.remarks)


def pictures(source) -> np.ndarray:
    return np.stack([picture for _, picture in source.read(source.indices.tolist())])


def test_camera_masks_bodies_and_pixels_are_those_that_were_filmed(scene, recording):
    recorded = scene.cameras["camera"]
    assert np.allclose(recorded.camera.K, recording.camera.K, atol=1e-12)
    assert np.array_equal(recorded.camera.distortion, recording.camera.distortion)
    assert np.array_equal(pictures(recorded.masks), recording.masks)
    assert np.array_equal(pictures(recorded.frames), recording.frames)
    assert recorded.background is None
    assert scene.behind_person == "white"
    assert np.allclose(scene.meshes.sequence.vertices, recording.bodies, atol=1e-5)
    assert (scene.fps, scene.working_fps, scene.truth) == (24.0, 12.0, None)


def test_a_surplus_pose_at_the_start_is_found_by_outlines(scene):
    assert "12 frames, 12 masks, 13 poses, 12 keypoints" in remarks(scene)
    assert "(shift +1)" in remarks(scene)
    assert "better than the other end" in remarks(scene)


def test_a_sound_subject_passes_every_check(scene):
    findings = check_dataset(scene)
    assert findings.warnings == ()
    overlaps = {key: value for key, value in findings.measured.items() if "overlap" in key}
    assert max(overlaps, key=overlaps.get) == "overlap at +0 of camera"


def test_the_written_scene_gives_an_undistorted_clip_that_the_body_fits(scene, recording, tmp_path):
    write_dataset(scene, tmp_path / "scene")
    written = open_scene(tmp_path / "scene")
    ingested = ingest_meshes(written)
    assert ingested.located
    assert ingested.coordinates == "world"
    clip = extract_clip(written, CaptureConfig())
    assert clip.camera.is_pinhole
    assert clip.fps == 12.0
    assert clip.frame_indices[~clip.held_out].tolist() == list(range(0, FRAMES, 2))
    assert clip.frame_indices[clip.held_out].tolist() == [1, 3, 5, 7, 9]
    bodies = ingested.meshes.at(clip.frame_indices)
    fits = overlap(silhouettes(bodies.vertices, bodies.faces, clip.camera), clip.masks).mean()
    bent = silhouettes(recording.bodies, recording.model.faces, recording.camera.undistorted())
    assert fits > 0.95
    assert overlap(bent, recording.masks).mean() < fits - 0.02  # It would show.
    assert written.up.tolist() == [0, -1, 0]


def test_every_choice_is_followed(write, models, recording):
    choices = PeopleSnapshotConfig(
        body_model=models,
        first_frame=3,
        frames=6,
        stride=3,
        background="filmed",
        mask_erosion_px=4,
        pose_alignment="start",
        body_shape="consensus",
    )
    moved = replace(recording.camera, t=np.array([0.1, 0.0, 0.3]))
    scene = read_people_snapshot(write(surplus="end", camera=moved), choices)
    assert "camera_rt and camera_t are set to 0" in remarks(scene)
    assert not scene.cameras["camera"].camera.t.any()
    recorded = scene.cameras["camera"]
    assert recorded.frames.indices.tolist() == [3, 4, 5, 6, 7, 8]
    assert scene.meshes.sequence.frame_indices.tolist() == [3, 4, 5, 6, 7, 8]
    assert scene.working_fps == 8.0
    assert np.array_equal(pictures(recorded.frames), recording.frames[3:9])
    assert scene.behind_person == "kept"
    eroded = pictures(recorded.masks)
    assert 0.5 < eroded.sum() / recording.masks[3:9].sum() < 0.95
    assert not (eroded & ~recording.masks[3:9]).any()
    bare = np.abs(scene.meshes.sequence.vertices - recording.bodies[3:9]).max()
    assert 1e-3 < bare < 0.1  # Without the clothes, which stand off by less.


def test_counts_that_differ_by_more_are_refused_unless_allowed(write, models, recording):
    folder = write(masks=recording.masks[:-3])
    assert "12 frames, 9 masks, 12 poses" in refusal(folder, body_model=models)
    choices = PeopleSnapshotConfig(body_model=models, most_surplus=3, pose_alignment="start")
    scene = read_people_snapshot(folder, choices)
    assert scene.cameras["camera"].frames.indices.tolist() == list(range(9))
    assert "joined from the first: 9 are used" in remarks(scene)


def test_a_pose_too_few_costs_a_frame(write, models, recording):
    folder = write(pose=recording.pose[:-1], translation=recording.translation[:-1])
    choices = PeopleSnapshotConfig(body_model=models, pose_alignment="start")
    scene = read_people_snapshot(folder, choices)
    assert scene.cameras["camera"].frames.indices.tolist() == list(range(FRAMES - 1))
    assert "1 frames at the end have no pose" in remarks(scene)


def test_without_a_body_model_the_error_says_where_to_get_it_and_what_works_without(write):
    folder = write()
    told = refusal(folder)
    for part in ("female SMPL model", "smpl.is.tue.mpg.de", "consensus.obj", "bodies=none"):
        assert part in told
    scene = read_people_snapshot(folder, PeopleSnapshotConfig(bodies="none"))
    assert scene.meshes is None
    assert "--meshes" in remarks(scene)


def test_a_video_that_was_turned_is_refused(write, recording):
    folder = write()
    wide = np.concatenate([recording.frames, recording.frames[:, :, :48]], axis=2)
    write_lossless(folder / f"{folder.name}.mp4", wide)
    told = refusal(folder)
    assert "must be 96 x 96 as the calibration says, got 144 x 96" in told
    assert "turned" in told


def test_masks_of_another_size_are_refused(write, recording):
    assert "masks.hdf5 must be 96 x 96" in refusal(write(masks=recording.masks[:, ::2]))


def test_an_estimate_of_the_whole_video_fits_the_imported_clip(write, recording, tmp_path):
    chosen = PeopleSnapshotConfig(bodies="none", first_frame=3, frames=6)
    write_dataset(read_people_snapshot(write(), chosen), tmp_path / "scene")
    middles = recording.bodies.mean(axis=1)
    side = np.full(FRAMES, 60.0)
    record = {
        "pred_cam": np.column_stack(
            [2 * 150 / middles[:, 2] / (1.1 * side), *np.zeros((2, FRAMES))]
        ),
        "bboxes": np.column_stack([recording.camera.project(middles), side, side]),
        "verts": (recording.bodies - middles[:, None]).astype(np.float32),
        "frame_ids": np.arange(FRAMES),
    }
    vibe = write_people(tmp_path / "vibe_output.pkl", {1: record})
    faces = Trimesh(recording.bodies[0], recording.model.faces, process=False)
    (tmp_path / "faces.obj").write_text(export_obj(faces))
    estimate = EstimateConfig(faces=tmp_path / "faces.obj")
    ingested = ingest_meshes(open_scene(tmp_path / "scene"), vibe, estimate)
    assert ingested.meshes.frame_indices.tolist() == [3, 4, 5, 6, 7, 8]
    assert np.array_equal(ingested.meshes.vertices, record["verts"][3:9])
    assert any("frames 0 to 11 of the source" in said for said in ingested.warnings)
