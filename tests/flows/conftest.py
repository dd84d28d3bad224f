"""A toy scene, and the whole flow run on it once for the session."""

from __future__ import annotations

import pytest

from mocoflow_core.synthetic.toy import write_toy_scene


@pytest.fixture(scope="session")
def toy_scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene") / "toy"
    write_toy_scene(folder)
    return folder


@pytest.fixture(scope="session")
def store_url(tmp_path_factory):
    return str(tmp_path_factory.mktemp("store"))


@pytest.fixture(scope="session")
def reconstruct(prefect_server, store_url):
    """The flow with the toy preset and the session's store."""
    from flows.reconstruct import reconstruct as flow

    def run(scene, out, **changes):
        return flow(scene=scene, out=out, **{"preset": "toy", "store": store_url, **changes})

    return run


@pytest.fixture(scope="session")
def first_run(reconstruct, toy_scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "first"
    return out, reconstruct(toy_scene, out)
