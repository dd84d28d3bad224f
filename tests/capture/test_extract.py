"""From files to clips: what comes out, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image

from mocoflow_core.body.silhouette import overlap, silhouettes
from mocoflow_core.capture.clip import Clip
from mocoflow_core.capture.extract import (
    CaptureConfig,
    ClipNeeds,
    extract_clip,
    extract_evaluation,
)
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.capture.strange_frames import sound_clip
from mocoflow_core.errors import InputError
from mocoflow_core.io.video import write_video
from tests.capsule_person import (
    SceneRecipe,
    capsule_person,
    default_recipe,
    edit_description,
    look_at,
    room,
    walking,
    write_scene,
)


@pytest.fixture
def folder(tmp_path):
    return write_scene(tmp_path, default_recipe())


def extracted(folder, **changes) -> Clip:
    return extract_clip(open_scene(folder), CaptureConfig(**changes))


def refusal(folder) -> str:
    with pytest.raises(InputError) as refused:
        extracted(folder)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def without(key, camera="cam00"):
    return lambda description: description["cameras"][camera].pop(key)


def pixels(clip: Clip) -> list[bytes]:
    arrays = (clip.frames, clip.masks, clip.background, clip.frame_indices, clip.held_out)
    return [np.ascontiguousarray(array).tobytes() for array in arrays]


def test_a_scene_at_its_own_size_and_rate_comes_out_as_written(folder):
    clip = extracted(folder)
    assert clip.frames.shape == (6, 96, 64, 3)
    assert clip.frame_indices.tolist() == list(range(6))
    assert np.array_equal(clip.background, room(64, 96, 0))
    meshes = default_recipe().meshes
    assert np.array_equal(clip.masks, silhouettes(meshes.vertices, meshes.faces, clip.camera))


def test_intrinsics_follow_the_working_size_exactly(folder):
    clip = extracted(folder, max_side=41)
    full = open_scene(folder).cameras["cam00"]
    assert (clip.camera.width, clip.camera.height) == (27, 41)
    scale = np.array([27 / 64, 41 / 96])
    points = default_recipe().meshes.vertices[0].astype(float)
    assert np.allclose(clip.camera.project(points), full.project(points) * scale)
    meshes = default_recipe().meshes
    bodies = silhouettes(meshes.vertices, meshes.faces, clip.camera)
    # A third of the pixels of so small a person lie on its edge.
    assert overlap(bodies, clip.masks).min() > 0.85


def test_distortion_is_removed_from_frames_and_masks(tmp_path):
    recipe = default_recipe()
    bent = replace(recipe.cameras["cam00"], distortion=np.array([-0.3, 0.1, 0, 0, 0]))
    folder = write_scene(tmp_path, recipe)
    edit_description(folder, lambda d: d["cameras"]["cam00"].update(bent.to_json()))
    straight = write_scene(tmp_path / "straight", recipe)
    clip = extracted(folder)
    assert clip.camera.is_pinhole
    assert not np.array_equal(clip.masks, extracted(straight).masks)
    # Frame and mask moved together: the person is still red where the mask is.
    inside = np.stack(
        [cv2.erode(mask.astype(np.uint8), np.ones((3, 3))) > 0 for mask in clip.masks]
    )
    assert np.abs(clip.frames[inside].astype(int) - [230, 30, 40]).max() < 90


def test_a_higher_source_rate_gives_held_out_frames_between(tmp_path):
    recipe = replace(default_recipe(frames=21), fps=48.0)
    clip = extracted(write_scene(tmp_path, recipe))
    assert clip.frame_indices[~clip.held_out].tolist() == [0, 4, 8, 12, 16, 20]
    assert clip.frame_indices[clip.held_out].tolist() == [2, 6, 10, 14, 18]
    assert clip.fps == 12


def test_frames_that_are_not_among_those_to_be_looked_at_leave_no_trace(tmp_path):
    recipe = replace(default_recipe(frames=21), fps=48.0, background=False)
    folder = write_scene(tmp_path, recipe)
    only = np.arange(0, 11, dtype=np.int32)

    def partly() -> Clip:
        return extract_clip(open_scene(folder), CaptureConfig(), only=only)

    before = partly()
    assert before.frame_indices.tolist() == [0, 2, 4, 6, 8, 10]
    for index in range(11, 21):
        noise = np.random.default_rng(index).integers(0, 256, (96, 64, 3))
        Image.fromarray(noise.astype(np.uint8)).save(folder / f"frames/cam00/{index:06d}.png")
    assert pixels(partly()) == pixels(before)
    [others] = extract_evaluation(open_scene(folder), np.arange(21), CaptureConfig(), only)
    assert others.frame_indices.tolist() == only.tolist()


def test_held_out_frames_leave_no_trace_in_the_plate(tmp_path):
    recipe = replace(default_recipe(frames=21), fps=48.0, background=False)
    folder = write_scene(tmp_path, recipe)
    before = extracted(folder)
    for index in before.frame_indices[before.held_out]:
        noise = np.random.default_rng(index).integers(0, 256, (96, 64, 3))
        cv2.imwrite(str(folder / "frames/cam00" / f"{index:06d}.png"), noise)
    assert np.array_equal(extracted(folder).background, before.background)


def test_masks_without_a_plate_give_the_plate(tmp_path):
    clip = extracted(write_scene(tmp_path, replace(default_recipe(16), background=False)))
    seen = (~clip.masks).any(axis=0)
    assert np.array_equal(clip.background[seen], room(64, 96, 0)[seen])


def test_a_plate_without_masks_gives_the_masks(tmp_path):
    clip = extracted(write_scene(tmp_path, replace(default_recipe(), masks=False)))
    meshes = default_recipe().meshes
    bodies = silhouettes(meshes.vertices, meshes.faces, clip.camera)
    assert overlap(bodies, clip.masks).min() > 0.95


def test_neither_masks_nor_plate_makes_both_of_what_moves_and_says_so(tmp_path):
    meshes = capsule_person(np.zeros(16), np.zeros(16), np.linspace([-1.6, 0, 0], [1.6, 0, 0], 16))
    camera = look_at([0, -3.5, 1.2], [0, 0, 0.9], 70, 128, 96, "cam00")
    recipe = SceneRecipe(meshes, {"cam00": camera}, masks=False, background=False)
    clip = extracted(write_scene(tmp_path, recipe))
    assert np.array_equal(clip.background, room(128, 96, 0))
    bodies = silhouettes(meshes.vertices, meshes.faces, clip.camera)
    assert overlap(bodies, clip.masks).min() > 0.9
    assert "neither masks nor a background" in clip.remarks[0]


def test_a_plate_that_had_to_be_guessed_somewhere_says_how_much(tmp_path):
    turning = capsule_person(np.linspace(0, 1, 6), np.zeros(6), np.zeros((6, 3)))
    recipe = replace(default_recipe(), meshes=turning, background=False)
    clip = extracted(write_scene(tmp_path, recipe))
    share = 100 * clip.masks.all(axis=0).mean()
    assert share > 1
    [remark] = clip.remarks
    assert f"covers {share:.2g} % of the picture" in remark
    clip.save(tmp_path)
    assert Clip.load(tmp_path).remarks == clip.remarks


def test_masks_of_another_size_are_refused(folder):
    cv2.imwrite(str(folder / "masks/cam00/000003.png"), np.full((48, 32), 255, np.uint8))
    assert "32 x 48" in refusal(folder)


def test_a_missing_train_frame_is_refused(folder):
    (folder / "frames/cam00/000002.png").unlink()
    assert "no frame 2 " in refusal(folder)


def test_a_missing_train_mask_is_refused(folder):
    (folder / "masks/cam00/000004.png").unlink()
    assert "frame 4" in refusal(folder)


def test_frames_of_another_size_than_the_camera_are_refused(folder):
    edit_description(folder, lambda d: d["cameras"]["cam00"].update(width=96, height=64))
    assert "64 x 96" in refusal(folder)


def test_masks_that_stay_dark_are_refused(folder):
    for path in (folder / "masks/cam00").iterdir():
        cv2.imwrite(str(path), (cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 127).astype(np.uint8))
    assert "values up to 1" in refusal(folder)


def test_masks_without_a_person_are_refused(folder):
    for path in (folder / "masks/cam00").iterdir():
        cv2.imwrite(str(path), np.zeros((96, 64), np.uint8))
    assert "empty masks" in refusal(folder)


def test_a_damaged_image_is_refused(folder):
    (folder / "frames/cam00/000001.png").write_bytes(b"\x89PNG broken")
    assert "000001.png" in refusal(folder)


def test_masks_of_one_bit_are_read(folder):
    before = extracted(folder)
    for path in (folder / "masks/cam00").iterdir():
        Image.open(path).convert("1").save(path)
    assert np.array_equal(extracted(folder).masks, before.masks)


def test_a_video_gives_the_same_clip_as_its_frames(folder):
    before = extracted(folder)
    write_video(folder / "cam00.mp4", before.frames, 12)
    edit_description(folder, lambda d: d["cameras"]["cam00"].update(frames="cam00.mp4"))
    after = extracted(folder)
    assert np.array_equal(after.frame_indices, before.frame_indices)
    # Video keeps colour at half the resolution, so brightness is compared.
    assert np.abs(after.frames.mean(axis=-1) - before.frames.mean(axis=-1)).mean() < 4


def test_a_video_that_cannot_be_decoded_is_refused(folder):
    (folder / "cam00.mp4").write_bytes(b"not a video at all" * 50)
    edit_description(folder, lambda d: d["cameras"]["cam00"].update(frames="cam00.mp4"))
    assert "cam00.mp4" in refusal(folder)


def test_nothing_of_other_cameras_or_truth_reaches_the_clip(folder):
    before = pixels(extracted(folder))
    for path in (folder / "frames/cam01").iterdir():
        cv2.imwrite(str(path), np.random.default_rng(0).integers(0, 256, (96, 64, 3)))
    edit_description(folder, lambda d: d["cameras"]["cam01"].update(t=[9.0, 9.0, 9.0]))
    assert pixels(extracted(folder)) == before
    edit_description(folder, lambda d: d["cameras"].pop("cam01"))
    assert pixels(extracted(folder)) == before


def test_evaluation_clips_are_the_other_cameras_at_the_frames_with_masks(folder):
    for index in (0, 2):
        (folder / f"masks/cam01/{index:06d}.png").unlink()
    (folder / "frames/cam01/000004.png").unlink()
    [clip] = extract_evaluation(
        open_scene(folder), np.array([0, 1, 2, 3, 4], np.int32), CaptureConfig()
    )
    assert clip.camera.name == "cam01"
    assert clip.frame_indices.tolist() == [1, 3]
    assert clip.held_out.all()


def test_cameras_without_masks_are_not_scored(folder):
    edit_description(folder, without("masks", "cam01"))
    assert (
        extract_evaluation(open_scene(folder), np.arange(6, dtype=np.int32), CaptureConfig()) == []
    )


def test_a_clip_survives_saving(folder, tmp_path):
    clip = extracted(folder)
    (tmp_path / "saved").mkdir()
    clip.save(tmp_path / "saved")
    loaded = Clip.load(tmp_path / "saved")
    assert pixels(loaded) == pixels(clip)
    assert json.dumps(loaded.camera.to_json()) == json.dumps(clip.camera.to_json())


def test_a_longer_clip_costs_no_more_frames_in_memory(tmp_path):
    camera = {"cam00": look_at([0, -3.5, 1.2], [0, 0, 0.9], 60, 32, 48, "cam00")}
    recipe = replace(default_recipe(), meshes=walking(60), cameras=camera, fps=120.0)
    clip = extracted(write_scene(tmp_path, recipe))
    assert len(clip.frames) == 6 + 5


def test_a_plate_that_is_asked_for_is_made_though_one_is_given(folder):
    cv2.imwrite(str(folder / "background/cam00.png"), np.zeros((96, 64, 3), np.uint8))
    scene = open_scene(folder)
    given = extract_clip(scene, CaptureConfig())
    made = extract_clip(scene, CaptureConfig(), ClipNeeds(background=True))
    assert given.background.max() == 0
    visible = ~made.masks.any(axis=0)
    assert np.array_equal(made.background[visible], room(64, 96, 0)[visible])


def test_masks_that_are_asked_for_are_made_though_some_are_given(folder):
    for path in (folder / "masks/cam00").iterdir():
        cv2.imwrite(str(path), np.full((96, 64), 255, np.uint8))
    scene = open_scene(folder)
    assert extract_clip(scene, CaptureConfig()).masks.all()
    made = extract_clip(scene, CaptureConfig(), ClipNeeds(masks=True))
    meshes = default_recipe().meshes
    truth = silhouettes(meshes.vertices, meshes.faces, made.camera)
    assert overlap(made.masks, truth).min() > 0.9


def test_a_frame_that_is_shown_twice_is_worked_on_once(folder):
    for kind in ("frames", "masks"):
        files = sorted((folder / kind / "cam00").iterdir())
        files[3].write_bytes(files[2].read_bytes())
    scene = open_scene(folder)
    assert extract_clip(scene, CaptureConfig()).frame_indices.tolist() == [0, 1, 2, 4, 5]
    kept = extract_clip(scene, CaptureConfig(), ClipNeeds(repeated_frames=True))
    assert kept.frame_indices.tolist() == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("needs", "phase"),
    [
        (ClipNeeds(), "mask 0 of cam00"),
        (ClipNeeds(background=True), "background plate"),
        (ClipNeeds(masks=True), "masks from the background"),
        (ClipNeeds(background=True, masks=True), "masks from the background"),
    ],
)
def test_how_far_it_is_only_grows_through_all_that_takes_long(folder, needs, phase):
    only_grows(folder, needs, "mask 0 of cam00", phase)


@pytest.mark.parametrize(
    "needs",
    [ClipNeeds(), ClipNeeds(background=True), ClipNeeds(background=True, masks=True)],
)
def test_so_it_does_where_masks_are_made_of_the_background(folder, needs):
    edit_description(folder, lambda description: description["cameras"]["cam00"].pop("masks"))
    only_grows(folder, needs, "masks from the background")


def only_grows(folder, needs, *phases):
    told = []
    extract_clip(open_scene(folder), CaptureConfig(), needs, progress=lambda *now: told.append(now))
    shares, words = zip(*told, strict=True)
    assert list(shares) == sorted(shares)
    assert 0 < shares[0] < shares[-1] <= 1
    assert {"frame 0 of cam00", "frames compared", *phases} <= set(words)


def test_checking_a_clip_tells_of_every_frame(folder):
    told = []
    clip = extracted(folder)
    sound_clip(clip, 30, lambda *now: told.append(now))
    assert [share for share, _ in told] == [(n + 1) / len(clip.frames) for n in range(len(told))]
    assert told[-1][0] == 1
