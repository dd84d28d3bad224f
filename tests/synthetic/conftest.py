from __future__ import annotations

import pytest

from mocoflow_core.synthetic.configuration import SyntheticConfig
from mocoflow_core.synthetic.person import Person
from mocoflow_core.synthetic.scene_writer import write_scene
from mocoflow_core.synthetic.toy import write_toy_scene


@pytest.fixture(scope="session")
def small_turn():
    return SyntheticConfig(frames=4, width=96, height=96, cameras=3)


@pytest.fixture(scope="session")
def person(small_turn):
    return Person.load(small_turn.shape)


@pytest.fixture(scope="session")
def turn_scene(small_turn, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes") / "turn"
    write_scene(small_turn, folder)
    return folder


@pytest.fixture(scope="session")
def toy_scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes") / "toy"
    write_toy_scene(folder)
    return folder
