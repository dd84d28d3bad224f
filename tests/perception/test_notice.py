"""What comes with the package names where it comes from, under which licence."""

from __future__ import annotations

import pytest

from mocoflow_core.perception.embedded import DIGESTS, FOLDER


@pytest.mark.parametrize("name", DIGESTS)
def test_every_file_of_weights_has_its_origin_digest_and_licence(name):
    notice, licences = ((FOLDER / file).read_text() for file in ("NOTICE.md", "LICENSES.md"))
    assert f"`{name}.safetensors`" in notice
    assert DIGESTS[name] in notice
    assert f"`{name}`" in licences


def test_no_file_of_weights_is_there_without_being_used():
    assert {file.stem for file in FOLDER.glob("*.safetensors")} == set(DIGESTS)
