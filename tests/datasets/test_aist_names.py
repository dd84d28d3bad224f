"""Names of AIST recordings, and the real lists of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from mocoflow_core.datasets.aist_names import (
    BAD_VIEWS,
    NEVER_RELEASED,
    parse_name,
    read_ignore_list,
    require_annotated,
)
from mocoflow_core.errors import InputError

DATA = Path(__file__).parents[1] / "data/aist"


@pytest.mark.parametrize(
    ("video", "sequence"),
    [
        ("gBR_sBM_c01_d04_mBR0_ch01", "gBR_sBM_cAll_d04_mBR0_ch01"),
        ("videos/gWA_sFM_c09_d27_mWA5_ch20.mp4", "gWA_sFM_cAll_d27_mWA5_ch20"),
        ("gJB_sBM_cAll_d07_mJB3_ch05.pkl", "gJB_sBM_cAll_d07_mJB3_ch05"),
        ("sSH_c01_v0", "sSH_cAll_v0"),
    ],
)
def test_the_camera_tag_is_the_third_or_with_three_tags_the_second(video, sequence):
    assert parse_name(video).sequence == sequence


def test_a_sequence_names_its_video_of_each_camera():
    name = parse_name("gBR_sBM_cAll_d04_mBR0_ch01")
    assert name.video("c09") == "gBR_sBM_c09_d04_mBR0_ch01"
    assert parse_name(name.video("c09")).camera == "c09"


@pytest.mark.parametrize("text", ["dance", "gBR_sBM", "gBR_sBM_d04_mBR0_ch01", "a_b_c_d"])
def test_other_names_are_refused(text):
    with pytest.raises(InputError, match="AIST"):
        parse_name(text)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("gBR_sGR_c01_d04d05d06_mBR0_ch01", "a group of three dancers"),
        ("gBR_sMC_c01_d04_mBR0_ch01", "a moving camera"),
        ("sSH_c01_v0", "a showcase"),
        ("gBR_sXX_c01_d04_mBR0_ch01", "another kind"),
    ],
)
def test_situations_without_annotations_are_refused_with_the_reason(name, why):
    with pytest.raises(InputError, match=why):
        require_annotated(parse_name(name))


def test_three_dancer_tags_do_not_move_the_camera_tag():
    name = parse_name("gBR_sGR_c03_d04_d05_d06_mBR0_ch01")
    assert (name.camera, name.situation) == ("c03", "sGR")


def test_basic_and_advanced_dances_are_annotated():
    require_annotated(parse_name("gBR_sBM_c01_d04_mBR0_ch01"))
    require_annotated(parse_name("gBR_sFM_c01_d04_mBR0_ch01"))


def test_lines_of_ignore_lists_lose_blanks_and_endings(tmp_path):
    file = tmp_path / "ignore_list.txt"
    file.write_text("gBR_sBM_cAll_d04_mBR0_ch07\ngHO_sFM_cAll_d20_mHO5_ch13 \r\n\n"
                    "  gJB_sBM_cAll_d07_mJB2_ch06.json\n")  # fmt: skip
    assert read_ignore_list(file) == {
        "gBR_sBM_cAll_d04_mBR0_ch07",
        "gHO_sFM_cAll_d20_mHO5_ch13",
        "gJB_sBM_cAll_d07_mJB2_ch06",
    }


def test_the_real_ignore_list_names_annotated_sequences_only():
    ignored = read_ignore_list(DATA / "ignore_list.txt")
    assert len(ignored) == 45
    for name in ignored:
        require_annotated(parse_name(name))
        assert parse_name(name).sequence == name


def test_bad_and_unreleased_views_have_names_of_videos():
    for name in (*BAD_VIEWS, *NEVER_RELEASED):
        assert parse_name(name).text == name
        assert parse_name(name).camera in {f"c{number:02d}" for number in range(1, 10)}
