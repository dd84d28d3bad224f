from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocoflow_core.body.fit.fit_body import BodyFitConfig, fit_body
from mocoflow_core.body.fit.landmark_misfit import LandmarkConfig
from mocoflow_core.body.fit.mask_misfit import MaskConfig
from mocoflow_core.body.fit.posed_body import PosedBody
from mocoflow_core.body.fit.sightings import Sightings
from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.errors import InputError
from tests.body.fit.made_movement import (
    BODY,
    FPS,
    keypoints_of,
    made_camera,
    made_pose,
    seen,
)

POSE = made_pose()
STATURE = BODY.reading("stature_m", POSE.shape)
KNOWN = BodyFitConfig(height_m=STATURE)


def fitted_keypoints(fitted):
    return fitted.meshes.keypoint_regressor @ fitted.meshes.vertices


def from_hips(keypoints):
    return keypoints - keypoints[:, [11, 12]].mean(1, keepdims=True)


def mean_distance(first, second):
    return np.linalg.norm(first - second, axis=-1).mean()


EXACT = KNOWN.model_copy(update={"landmarks": LandmarkConfig(picture_error_m=0.003)})


@pytest.fixture(scope="module")
def exact():
    return fit_body(seen(keypoints_of(POSE), made_camera()), None, made_camera(), FPS, EXACT)


def test_exact_keypoints_are_recovered(exact):
    truth, found = keypoints_of(POSE), fitted_keypoints(exact)
    assert mean_distance(from_hips(found), from_hips(truth)) < 0.01
    assert mean_distance(found, truth) < 0.03


def test_the_body_moves_with_the_camera(exact):
    R = Rotation.from_euler("xyz", [20, 130, -10], degrees=True).as_matrix()
    camera = made_camera(R, np.array([0.5, -2.0, 1.0]))
    sightings = seen(camera.to_world(keypoints_of(POSE)), camera)
    moved = fit_body(sightings, None, camera, FPS, EXACT)
    back = camera.to_camera(moved.meshes.vertices.astype(np.float64))
    np.testing.assert_allclose(back, exact.meshes.vertices, atol=1e-4)


def test_a_frame_without_a_detection_is_bridged(exact):
    sightings = seen(keypoints_of(POSE), made_camera())
    places, confidence = sightings.places[:, :17].copy(), sightings.confidence[:, :17].copy()
    places[4], confidence[4] = np.nan, 0.0
    fitted = fit_body(Sightings.of(places, confidence), None, made_camera(), FPS, KNOWN)
    assert mean_distance(fitted_keypoints(fitted)[4], keypoints_of(POSE)[4]) < 0.05
    assert np.isnan(fitted.landmark_px[4])
    assert any("1 of 8 frames" in warning for warning in fitted.warnings)


def test_a_taller_person_stands_farther_away_in_proportion(exact):
    taller = EXACT.model_copy(update={"height_m": 1.1 * STATURE})
    fitted = fit_body(seen(keypoints_of(POSE), made_camera()), None, made_camera(), FPS, taller)
    ratio = fitted.pose.places[:, 2].mean() / exact.pose.places[:, 2].mean()
    assert ratio == pytest.approx(1.1, abs=0.01)


def test_landmarks_in_space_settle_what_the_picture_leaves_open():
    """Places in the picture are noisy; those in space are right, but for their size."""
    random = np.random.default_rng(0)
    truth = keypoints_of(POSE)
    places = made_camera().project(truth) + random.normal(0, 2, (*truth.shape[:2], 2))
    confidence = np.ones(truth.shape[:2])
    flat = fit_body(Sightings.of(places, confidence), None, made_camera(), FPS, KNOWN)
    space = from_hips(truth) * 1.2
    deep = fit_body(Sightings.of(places, confidence, space), None, made_camera(), FPS, KNOWN)
    errors = [mean_distance(from_hips(fitted_keypoints(f)), from_hips(truth)) for f in (deep, flat)]
    assert errors[0] < 0.8 * errors[1]


def test_outlines_are_laid_onto_the_masks():
    camera, truth = made_camera(), keypoints_of(POSE)
    masks = silhouettes(PosedBody.of(BODY, POSE).vertices(), BODY.faces, camera)
    places = camera.project(truth) + np.random.default_rng(1).normal(0, 3, (*truth.shape[:2], 2))
    sightings = Sightings.of(places, np.ones(truth.shape[:2]))
    by_landmarks = fit_body(sightings, None, camera, FPS, KNOWN)
    by_both = fit_body(sightings, masks, camera, FPS, KNOWN)
    drawn = silhouettes(by_landmarks.meshes.vertices, BODY.faces, camera)
    assert np.nanmean(by_both.silhouette_iou) > overlap(drawn, masks).mean() + 0.02


def test_an_empty_mask_says_nothing():
    camera = made_camera()
    masks = silhouettes(PosedBody.of(BODY, POSE).vertices(), BODY.faces, camera)
    masks[2] = False
    few = KNOWN.model_copy(update={"looks": 1, "masks": MaskConfig(outline_points=40)})
    fitted = fit_body(seen(keypoints_of(POSE), camera), masks, camera, FPS, few)
    assert np.isfinite(fitted.meshes.vertices).all()
    assert np.isnan(fitted.silhouette_iou[2])
    assert np.isfinite(np.delete(fitted.silhouette_iou, 2)).all()


@pytest.mark.parametrize("frames", [1, 2])
def test_very_short_clips_are_fitted(frames):
    pose = POSE.frames(slice(frames))
    fitted = fit_body(seen(keypoints_of(pose), made_camera()), None, made_camera(), FPS, KNOWN)
    assert mean_distance(from_hips(fitted_keypoints(fitted)), from_hips(keypoints_of(pose))) < 0.05


def test_masks_of_another_size_are_refused():
    sightings = seen(keypoints_of(POSE), made_camera())
    with pytest.raises(InputError, match="camera's size"):
        fit_body(sightings, np.zeros((8, 64, 64), bool), made_camera(), FPS, KNOWN)


def test_a_lens_with_distortion_is_refused():
    camera = replace(made_camera(), distortion=np.array([0.1, 0, 0, 0, 0]))
    with pytest.raises(InputError, match="Undistort"):
        fit_body(seen(keypoints_of(POSE), made_camera()), None, camera, FPS, KNOWN)


def test_what_is_saved_is_a_mesh_file_in_world_coordinates(exact, tmp_path):
    exact.save(tmp_path)
    with np.load(tmp_path / "meshes.npz", allow_pickle=False) as arrays:
        assert str(arrays["coordinates"]) == "world"
        assert bool(arrays["located"])
        np.testing.assert_array_equal(arrays["vertices"], exact.meshes.vertices)
    with np.load(tmp_path / "fit.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["angles"], exact.pose.angles)


def test_frames_that_may_be_held_out_change_nothing_and_are_bridged():
    camera, truth = made_camera(), keypoints_of(POSE)
    usable = np.arange(len(truth)) % 2 == 0
    masks = silhouettes(PosedBody.of(BODY, POSE).vertices(), BODY.faces, camera)
    few = KNOWN.model_copy(update={"rough_steps": 8, "steps": 8, "looks": 2})

    def fitted(shift_px):
        places = seen(truth, camera).places[:, :17].copy()
        places[~usable] += shift_px
        outlines = np.where(usable[:, None, None], masks, np.roll(masks, round(shift_px), axis=2))
        sightings = Sightings.of(places, np.ones(places.shape[:2]))
        return fit_body(sightings, outlines, camera, FPS, few, usable=usable)

    one, other = fitted(0.0), fitted(15.0)
    np.testing.assert_array_equal(one.meshes.vertices, other.meshes.vertices)
    assert np.isnan(one.silhouette_iou).tolist() == (~usable).tolist()
    assert not any("show nobody" in warning for warning in one.warnings)
    off = np.linalg.norm(from_hips(fitted_keypoints(one)) - from_hips(truth), axis=-1).mean(1)
    assert off[~usable][:-1].max() < off[usable].max() + 0.03


def test_a_clip_whose_usable_frames_show_nobody_is_refused():
    sightings = seen(keypoints_of(POSE), made_camera())
    with pytest.raises(InputError, match="no landmarks"):
        fit_body(sightings, None, made_camera(), FPS, KNOWN, usable=np.zeros(8, bool))
