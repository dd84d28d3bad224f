"""Masks of ZJU-MoCap, whatever their labels and channels."""

from __future__ import annotations

from pathlib import PurePosixPath

import numpy as np
import pytest
from PIL import Image

from mocoflow_core.datasets.zju_masks import find_masks, read_labels
from mocoflow_core.errors import InputError

PERSON = np.array([[0, 1, 1, 0], [0, 1, 0, 0]], bool)


def palette(person):
    image = Image.fromarray(person.astype(np.uint8) * 3)
    image.putpalette([0, 0, 0] * 256)  # Every label black: only the index tells.
    return image


@pytest.mark.parametrize(
    "image",
    [
        Image.fromarray(PERSON.astype(np.uint8)),
        Image.fromarray(PERSON.astype(np.uint8) * 19),
        Image.fromarray(PERSON),
        Image.fromarray(np.repeat(PERSON[..., None], 3, axis=-1).astype(np.uint8) * 255),
        Image.fromarray(np.stack([0 * PERSON, 0 * PERSON, PERSON], axis=-1).astype(np.uint8)),
        Image.fromarray(
            np.dstack([*[PERSON.astype(np.uint8)] * 3, np.full(PERSON.shape, 255, np.uint8)])
        ),
        palette(PERSON),
    ],
    ids=["labels", "dark labels", "1 bit", "3 channels", "one channel", "alpha", "palette"],
)
def test_any_value_but_zero_is_the_person_and_alpha_is_no_value(tmp_path, image):
    image.save(tmp_path / "mask.png")
    np.testing.assert_array_equal(read_labels(tmp_path / "mask.png"), PERSON)


def test_a_file_that_is_no_picture_is_refused(tmp_path):
    (tmp_path / "mask.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"mask\.png"):
        read_labels(tmp_path / "mask.png")


@pytest.fixture
def folder(tmp_path):
    """Frame 0 has both masks, 1 only the parsing labels, 2 none."""
    other = np.roll(PERSON, 1, axis=0)
    for kind, number, mask in (
        ("mask", 0, PERSON),
        ("mask_cihp", 0, other),
        ("mask_cihp", 1, other),
    ):
        (tmp_path / kind / "Camera_B1").mkdir(parents=True, exist_ok=True)
        Image.fromarray(mask).save(tmp_path / kind / "Camera_B1" / f"{number:06d}.png")
    return tmp_path


PICTURES = {number: PurePosixPath(f"Camera_B1/{number:06d}.jpg") for number in range(3)}


def test_the_union_holds_what_either_folder_calls_a_person(folder):
    masks = find_masks(folder, PICTURES, "union", (4, 2))
    assert masks.indices.tolist() == [0, 1]
    read = dict(masks.read([0, 1]))
    np.testing.assert_array_equal(read[0], PERSON | np.roll(PERSON, 1, axis=0))
    np.testing.assert_array_equal(read[1], np.roll(PERSON, 1, axis=0))


def test_one_folder_can_be_chosen(folder):
    masks = find_masks(folder, PICTURES, "mask", (4, 2))
    assert masks.indices.tolist() == [0]
    np.testing.assert_array_equal(dict(masks.read([0]))[0], PERSON)


def test_masks_mirror_the_time_stamped_names_up_to_the_last_dot(tmp_path):
    name = "CoreView_313_Camera_(1)_0001_2019-08-23_16-08-50.592"
    (tmp_path / "mask_cihp/Camera (1)").mkdir(parents=True)
    Image.fromarray(PERSON).save(tmp_path / f"mask_cihp/Camera (1)/{name}.png")
    pictures = {1: PurePosixPath(f"Camera (1)/{name}.jpg")}
    assert find_masks(tmp_path, pictures, "union", (4, 2)).indices.tolist() == [1]
