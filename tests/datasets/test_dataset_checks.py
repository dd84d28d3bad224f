"""What is wrong with a data set is refused or told with what was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mocoflow_core.datasets.dataset_checks import check_dataset
from mocoflow_core.errors import InputError
from tests.datasets.in_memory import MemoryFrames, walking_dataset, with_camera

SOUND = walking_dataset()


def recalibrated(name="front", **changes):
    return with_camera(SOUND, name, camera=replace(SOUND.cameras[name].camera, **changes))


def with_vertices(change, numbers=lambda numbers: numbers):
    sequence = SOUND.meshes.sequence
    changed = replace(
        sequence,
        vertices=change(sequence.vertices),
        frame_indices=numbers(sequence.frame_indices),
    )
    return replace(SOUND, meshes=replace(SOUND.meshes, sequence=changed))


def with_masks(change):
    masks = {number: change(mask) for number, mask in SOUND.cameras["front"].masks.pictures.items()}
    return with_camera(SOUND, "front", masks=MemoryFrames(masks))


def refusal(scene) -> str:
    with pytest.raises(InputError) as refused:
        check_dataset(scene)
    return str(refused.value)


def warnings(scene) -> str:
    return " | ".join(check_dataset(scene).warnings)


def test_a_sound_data_set_gives_measures_and_no_warning():
    findings = check_dataset(SOUND)
    assert findings.warnings == ()
    measured = findings.measured
    assert measured["frames"] == measured["masks"] == measured["meshes"] == 9
    assert 1.7 < measured["height_m"] < 1.8  # Capsules from 0.01 to 1.77 m.
    assert measured["distance_m of front"] == pytest.approx(3.5, abs=0.3)
    assert measured["overlap at +0 of front"] > 0.9
    assert measured["overlap at +0 of side"] > 0.9


def test_a_mirror_is_no_rotation():
    assert "determinant -1" in refusal(recalibrated(R=SOUND.cameras["front"].camera.R * [1, 1, -1]))


def test_a_negative_focal_length_is_refused():
    flipped = np.diag([-1.0, 1.0, 1.0]) @ SOUND.cameras["side"].camera.K
    assert "fx, fy > 0" in refusal(recalibrated("side", K=flipped))


def test_swapped_sides_are_refused():
    assert "must be 96 x 64" in refusal(recalibrated(width=96, height=64))


def test_masks_of_another_size_are_refused():
    assert "mask 20 of front must be 64 x 96" in refusal(with_masks(lambda mask: mask[::2, ::2]))


def test_a_principal_point_of_another_resolution_is_told():
    K = SOUND.cameras["front"].camera.K @ np.diag([4.0, 4.0, 1.0])
    K[:2, 2] *= 4
    assert "principal point (128, 192)" in warnings(replace(recalibrated(K=K), meshes=None))


def test_a_missing_train_frame_is_refused():
    frames = dict(SOUND.cameras["front"].frames.pictures)
    del frames[23]
    gap = with_camera(SOUND, "front", frames=MemoryFrames(frames))
    assert "no frame 23" in refusal(gap)


def test_frames_without_mask_or_body_are_counted():
    masks = dict(SOUND.cameras["front"].masks.pictures)
    del masks[22], masks[24]
    told = warnings(with_camera(SOUND, "front", masks=MemoryFrames(masks)))
    assert "2 frames of front have no mask, the first 22" in told
    assert "1 frames have no body mesh, the first 20" in warnings(
        with_vertices(lambda bodies: bodies[1:], lambda numbers: numbers[1:])
    )


def test_empty_masks_are_refused_and_inverted_ones_told():
    assert "empty ones" in refusal(with_masks(np.zeros_like))
    inverted = replace(with_masks(np.logical_not), meshes=None)
    assert "inverted" in warnings(inverted)


@pytest.mark.parametrize(("scale", "unit"), [(1000, "millimetres"), (100, "centimetres")])
def test_a_body_in_another_unit_is_refused_by_name(scale, unit):
    assert unit in refusal(with_vertices(lambda bodies: bodies * np.float32(scale)))


def test_a_camera_in_millimetres_is_refused():
    t = SOUND.cameras["side"].camera.t
    assert "unit of t of side" in refusal(recalibrated("side", t=1000 * t))


def test_a_camera_that_is_camera_to_world_is_refused():
    camera = SOUND.cameras["front"].camera
    assert "masks of front" in refusal(recalibrated(R=camera.R.T, t=camera.centre_world))


def test_a_body_nowhere_near_the_masks_is_refused():
    aside = np.float32([0.9, 0, 0])
    assert "overlap (IoU) of" in refusal(with_vertices(lambda bodies: bodies + aside))


def test_a_body_without_a_location_may_be_anywhere():
    away = with_vertices(lambda bodies: bodies + np.float32([9, 9, 9]))
    unlocated = replace(away, meshes=replace(away.meshes, located=False))
    assert check_dataset(unlocated).measured["height_m"] > 1.7


def test_bodies_in_the_cameras_axes_are_seen_as_those_in_the_world():
    camera = SOUND.cameras["front"].camera
    turned = with_vertices(lambda bodies: camera.to_camera(bodies).astype(np.float32))
    there = replace(turned, meshes=replace(turned.meshes, coordinates="camera"))
    assert check_dataset(there).measured == pytest.approx(check_dataset(SOUND).measured, abs=1e-3)


def test_bodies_that_are_a_frame_late_are_told():
    late = with_vertices(lambda bodies: bodies, lambda numbers: numbers + np.int32(1))
    assert "with the meshes moved by +1 frame" in warnings(late)


def test_what_evaluation_cameras_show_stands_apart():
    masks = {
        number: np.roll(mask, 20, axis=1)
        for number, mask in SOUND.cameras["side"].masks.pictures.items()
    }
    findings = check_dataset(with_camera(SOUND, "side", masks=MemoryFrames(masks)))
    assert findings.warnings == ()
    assert any("side: silhouettes overlap the masks by" in said for said in findings.elsewhere)


def test_a_giant_is_told():
    assert "2.6" in warnings(with_vertices(lambda bodies: bodies * np.float32(1.5)))


def test_a_jump_to_somebody_else_is_told():
    def jump(bodies):
        return np.concatenate([bodies[:8], bodies[8:] + np.float32([0, 0.7, 0])])

    assert "m/s at frame 27" in warnings(with_vertices(jump))
