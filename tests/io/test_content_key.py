from __future__ import annotations

from pathlib import Path

import pytest

from mocoflow_core.io.content_key import digest_file, digest_files, key_of


def key(**changes):
    arguments = {
        "stage": "fit",
        "algorithm_version": 1,
        "inputs": {"clip": "aa"},
        "configuration": {"rate": 0.1, "steps": 3},
    }
    return key_of(**{**arguments, **changes})


def test_the_order_of_the_fields_does_not_count():
    assert key() == key(configuration={"steps": 3, "rate": 0.1})


@pytest.mark.parametrize(
    "changes",
    [
        {"stage": "plan"},
        {"algorithm_version": 2},
        {"inputs": {"clip": "ab"}},
        {"inputs": {"other": "aa"}},
        {"configuration": {"rate": 0.1 + 1e-17 + 2e-17, "steps": 3}},
        {"configuration": {"rate": 0.1, "steps": 3.0}},
        {"configuration": {"rate": 0.1, "steps": "3"}},
    ],
)
def test_every_part_counts_to_the_last_bit(changes):
    assert key(**changes) != key()


def test_what_is_not_plain_data_is_refused():
    with pytest.raises(TypeError, match="PosixPath"):
        key(configuration={"folder": Path("/")})


def test_the_same_bytes_elsewhere_have_the_same_digest(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "frame.png").write_bytes(b"pixels")
    files = [{"frame.png": tmp_path / name / "frame.png"} for name in ("a", "b")]
    assert digest_files(files[0]) == digest_files(files[1])


def test_a_changed_byte_changes_the_digest_within_one_process(tmp_path):
    file = tmp_path / "video.mp4"
    file.write_bytes(b"pixels")
    before = digest_file(file)
    file.write_bytes(b"pixelt")
    assert digest_file(file) != before
