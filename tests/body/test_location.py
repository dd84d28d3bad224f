"""The location search finds what was taken away."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocoflow_core.body.ingest import IngestedMeshes
from mocoflow_core.body.located_meshes import LocatedMeshes
from mocoflow_core.body.location import locate_body
from mocoflow_core.body.location_config import LocationConfig
from mocoflow_core.body.silhouette import silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.errors import InputError
from tests.capsule_person import capsule_person, look_at, walking

FRAMES = 7
CAMERA = look_at([0.3, -3.0, 1.3], [0, 0, 0.9], 150, 128, 128)
MESHES = walking(FRAMES)
IN_CAMERA = CAMERA.to_camera(MESHES.vertices.astype(float))
# The root is no vertex and no mean of vertices, as with real estimators.
ROOTS = IN_CAMERA.mean(axis=1) + np.array([0.02, 0.1, 0.03])


def clip_of(masks, held_out=()) -> Clip:
    count = len(masks)
    return Clip(
        CAMERA,
        12.0,
        MESHES.frame_indices[:count],
        np.zeros((count, 1, 1, 3), np.uint8),
        masks,
        np.ones(count, bool),
        np.isin(np.arange(count), held_out),
        np.zeros((1, 1, 3), np.uint8),
    )


def root_centred() -> IngestedMeshes:
    vertices = (IN_CAMERA - ROOTS[:, None]).astype(np.float32)
    return IngestedMeshes(replace(MESHES, vertices=vertices), "camera-root-centred", False)


def root_centred_first(count) -> IngestedMeshes:
    bodies = root_centred()
    return replace(bodies, meshes=bodies.meshes.at(bodies.meshes.frame_indices[:count]))


@pytest.fixture(scope="module")
def masks():
    return silhouettes(MESHES.vertices, MESHES.faces, CAMERA)


def errors_m(located: LocatedMeshes):
    """Lateral and depth errors (T,) each, metres."""
    error = located.translations - ROOTS
    return np.linalg.norm(error[:, :2], axis=1), np.abs(error[:, 2])


def test_known_offsets_are_found(masks):
    located = locate_body(clip_of(masks), root_centred(), LocationConfig())
    lateral, depth = errors_m(located)
    # A pixel is 2 cm here; the wanted accuracy is 2 cm and 5 cm.
    assert np.median(lateral) < 0.007
    assert np.median(depth) < 0.025
    assert np.abs(located.meshes.vertices - MESHES.vertices).max() < 0.1
    assert not located.warnings


@pytest.mark.parametrize("shape", [cv2.MORPH_DILATE, cv2.MORPH_ERODE])
def test_clothes_and_tight_masks_do_not_change_the_depth(masks, shape):
    changed = np.stack(
        [cv2.morphologyEx(mask.astype(np.uint8), shape, np.ones((3, 3))) > 0 for mask in masks]
    )
    lateral, depth = errors_m(locate_body(clip_of(changed), root_centred(), LocationConfig()))
    # Growing by a pixel is 2 cm on all sides; matching areas would be off by 40 cm.
    assert np.median(lateral) < 0.015
    assert np.median(depth) < 0.05


def test_limbs_in_another_pose_do_not_pass_for_another_distance(masks):
    share = np.linspace(0, 1, FRAMES)
    places = np.stack([share - 0.5, 0.3 * np.sin(3 * share), 0 * share], axis=-1)
    wrong = capsule_person(2 * share, 0.4 * np.sin(6 * share) + 0.3, places)
    vertices = CAMERA.to_camera(wrong.vertices.astype(float)) - ROOTS[:, None]
    bodies = replace(wrong, vertices=vertices.astype(np.float32))
    located = locate_body(
        clip_of(masks), IngestedMeshes(bodies, "camera-root-centred", False), LocationConfig()
    )
    lateral, depth = errors_m(located)
    assert np.median(lateral) < 0.02
    assert np.median(depth) < 0.05
    assert depth.max() < 0.15


def test_frames_without_a_person_are_interpolated(masks):
    gaps = masks.copy()
    gaps[3:5] = False
    located = locate_body(clip_of(gaps), root_centred(), LocationConfig())
    lateral, depth = errors_m(located)
    assert (located.confidence[3:5] == 0).all()
    assert located.quality["least_confidence"] > 0.3
    assert np.isnan(located.residual[3:5]).all()
    assert lateral.max() < 0.05
    assert depth.max() < 0.1


def test_held_out_frames_are_not_looked_at(masks):
    spoilt = masks.copy()
    spoilt[3] = np.roll(spoilt[3], 40, axis=1)
    untouched = locate_body(clip_of(masks, held_out=[3]), root_centred(), LocationConfig())
    located = locate_body(clip_of(spoilt, held_out=[3]), root_centred(), LocationConfig())
    assert np.array_equal(located.translations, untouched.translations)
    assert errors_m(located)[0][3] < 0.05


def test_masks_cut_by_the_border_count_little(masks):
    cut = masks.copy()
    cut[3, 60:] = False
    cut[3] = np.roll(cut[3], 128 - 60, axis=0)
    located = locate_body(clip_of(cut), root_centred(), LocationConfig())
    assert located.confidence[3] < 0.05 * np.median(located.confidence)
    # The mask shows a body that is cut and 68 pixels, 1.4 m, lower; a tenth of that is believed.
    assert errors_m(located)[0][3] < 0.14
    assert f"1 of {FRAMES} masks" in located.warnings[0]


def _half(mask):
    upper = mask.copy()
    upper[np.flatnonzero(mask.any(axis=1)).mean().astype(int) :] = False
    return upper


def _blob(mask):
    rows, columns = np.indices(mask.shape)
    return (rows - 30) ** 2 + (columns - 20) ** 2 < 15**2


def located_at(meshes, masks) -> tuple[LocatedMeshes, np.ndarray]:
    """Root-centred bodies searched against their masks, and the errors (T, 3), metres."""
    in_camera = CAMERA.to_camera(meshes.vertices.astype(float))
    roots = in_camera.mean(axis=1)
    bodies = replace(meshes, vertices=(in_camera - roots[:, None]).astype(np.float32))
    clip = replace(
        clip_of(masks), frame_indices=meshes.frame_indices, has_mask=np.ones(len(masks), bool)
    )
    coarse = LocationConfig(grid_px=64, outline_px=192)
    located = locate_body(clip, IngestedMeshes(bodies, "camera-root-centred", False), coarse)
    return located, np.abs(located.translations - roots)


def test_masks_that_show_something_else_do_not_move_the_body():
    meshes = walking(14)
    masks = silhouettes(meshes.vertices, meshes.faces, CAMERA)
    for row, wrong in ((4, np.logical_not), (9, _half), (10, _blob)):
        masks[row] = wrong(masks[row])
    located, error = located_at(meshes, masks)
    assert error[:, :2].max() < 0.03
    assert error[:, 2].max() < 0.08
    assert located.confidence[[4, 10]].max() < 0.05
    assert located.confidence[9] < 0.5 * np.median(located.confidence)
    assert "2 frames (4, 10)" in located.warnings[-1]


def test_a_person_who_walks_out_of_the_picture_is_followed():
    """The border cuts up to half of the body in the last third of the clip."""
    count = 12
    places = np.zeros((count, 3))
    places[:, 0] = 1.4 * np.clip(np.linspace(-1, 1, count), 0, None)
    meshes = capsule_person(np.linspace(0, 1, count), np.zeros(count), places)
    masks = silhouettes(meshes.vertices, meshes.faces, CAMERA)
    whole = masks.sum(axis=(1, 2))
    assert whole[-1] < 0.6 * whole[0]
    located, error = located_at(meshes, masks)
    assert error[:, :2].max() < 0.03
    assert error[:, 2].max() < 0.12
    assert located.confidence[-1] < 0.3 * located.confidence[0]
    assert "cut by the image border" in located.warnings[0]


def test_a_first_translation_leads_where_the_mask_alone_misleads(masks):
    """Two people in every mask: the box says one large person between them."""
    both = masks[:1] | np.roll(masks[:1], 45, axis=2)
    bodies = root_centred_first(1)
    near = ROOTS[:1] + np.array([0.05, -0.05, 0.1])
    alone = locate_body(clip_of(both), bodies, LocationConfig())
    led = locate_body(clip_of(both), replace(bodies, first_translations=near), LocationConfig())
    assert errors_m(led)[1][0] < 0.25 < errors_m(alone)[1][0]
    unknown = replace(bodies, first_translations=np.full((1, 3), np.nan))
    untold = locate_body(clip_of(both), unknown, LocationConfig())
    assert np.array_equal(untold.translations, alone.translations)


def test_a_clip_of_cut_masks_alone_is_still_located():
    near = look_at([0.3, -3.0, 1.3], [0, 0, 0.9], 285, 128, 128)
    masks = silhouettes(MESHES.vertices, MESHES.faces, near)
    clip = replace(clip_of(masks), camera=near)
    lateral, _ = errors_m(locate_body(clip, root_centred(), LocationConfig()))
    assert np.median(lateral) < 0.3


def test_what_is_given_is_where_the_search_starts(masks):
    offset = np.array([0.15, -0.1, 0.4])
    wrong = CAMERA.to_world(IN_CAMERA + offset)
    given = IngestedMeshes(replace(MESHES, vertices=wrong.astype(np.float32)), "world", False)
    located = locate_body(clip_of(masks), given, LocationConfig())
    assert np.abs(np.median(located.translations, axis=0) + offset).max() < 0.03


def given_in_world(in_camera) -> IngestedMeshes:
    vertices = CAMERA.to_world(in_camera).astype(np.float32)
    return IngestedMeshes(replace(MESHES, vertices=vertices), "world", located=True)


def test_a_trusted_place_stays_where_the_poses_are_wrong(masks):
    # Everyone bows to the side: no place explains such masks.
    centres = IN_CAMERA.mean(axis=1, keepdims=True)
    bow = Rotation.from_euler("z", 50, degrees=True).as_matrix()
    given = given_in_world((IN_CAMERA - centres) @ bow.T + centres)
    located = locate_body(clip_of(masks), given, LocationConfig())
    assert not located.adopted
    assert located.given_mismatch < 2 * located.mismatch
    np.testing.assert_array_equal(located.translations, 0)
    assert np.abs(located.meshes.vertices - given.meshes.vertices).max() < 1e-6
    [warning] = located.warnings
    assert "the given location stays" in warning


def test_a_trusted_place_is_left_where_another_explains_the_masks(masks):
    given = given_in_world(IN_CAMERA + np.array([0.4, 0.1, 0.3]))
    located = locate_body(clip_of(masks), given, LocationConfig())
    assert located.adopted
    assert located.quality["given_mismatch"] > 2 * located.quality["mismatch"]
    assert np.abs(located.meshes.vertices - MESHES.vertices).max() < 0.1


def test_a_few_frames_that_were_given_far_off_are_moved(masks):
    offsets = np.zeros((FRAMES, 1, 3))
    offsets[[1, 3, 5]] = [0.6, 0.0, 0.0]
    located = locate_body(clip_of(masks), given_in_world(IN_CAMERA + offsets), LocationConfig())
    assert located.adopted
    assert np.abs(located.meshes.vertices - MESHES.vertices).max() < 0.1


def test_a_search_that_was_asked_for_by_hand_is_taken(masks):
    given = given_in_world(IN_CAMERA + np.array([0.05, 0.0, 0.0]))
    search = LocationConfig().where_asked_for()
    located = locate_body(clip_of(masks), given, search)
    assert located.adopted
    assert np.abs(located.meshes.vertices - MESHES.vertices).max() < 0.1


@pytest.mark.parametrize("distance", [2.0, 8.0, 40.0])
def test_the_target_may_be_anywhere_before_the_camera(distance):
    camera = look_at([0, -distance, 1.0], [0, 0, 0.9], 50 * distance, 128, 128)
    clip = replace(clip_of(silhouettes(MESHES.vertices, MESHES.faces, camera)), camera=camera)
    in_camera = camera.to_camera(MESHES.vertices.astype(float))
    roots = in_camera.mean(axis=1)
    bodies = replace(MESHES, vertices=(in_camera - roots[:, None]).astype(np.float32))
    located = locate_body(
        clip, IngestedMeshes(bodies, "camera-root-centred", False), LocationConfig()
    )
    error = np.abs(located.translations - roots)
    assert np.median(error[:, :2]) < 0.01
    # Depth follows from size: a share of the distance.
    assert np.median(error[:, 2]) < 0.02 * distance


@pytest.mark.parametrize("case", ["one pixel", "everything", "two people"])
def test_strange_masks_give_finite_locations_and_little_confidence(masks, case):
    strange = masks[:2].copy()
    if case == "two people":
        strange |= np.roll(strange, 45, axis=2)
    else:
        strange[:] = case == "everything"
        strange[:, 60, 60] = True
    located = locate_body(clip_of(strange), root_centred_first(2), LocationConfig())
    assert np.isfinite(located.translations).all()
    assert (located.meshes.vertices @ CAMERA.R.T[:, 2] + CAMERA.t[2]).mean() > 0
    assert located.confidence.max() < 0.5
    assert located.warnings


def test_masks_that_show_nobody_are_refused(masks):
    with pytest.raises(InputError, match="shows the person"):
        locate_body(clip_of(masks & False), root_centred(), LocationConfig())


def test_the_search_is_deterministic_and_survives_saving(masks, tmp_path):
    first = locate_body(clip_of(masks[:3]), root_centred_first(3), LocationConfig())
    second = locate_body(clip_of(masks[:3]), root_centred_first(3), LocationConfig())
    assert np.array_equal(first.translations, second.translations)
    first.save(tmp_path)
    loaded = LocatedMeshes.load(tmp_path)
    assert np.array_equal(loaded.translations, first.translations)
    assert np.array_equal(loaded.meshes.vertices, first.meshes.vertices)
    assert loaded.warnings == first.warnings
