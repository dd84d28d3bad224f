"""The curve on Prefect's page while a run goes on."""

from __future__ import annotations

from prefect import flow, task
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterKey

from mocoflow_core.training.clock import Seconds
from mocoflow_core.training.snapshots import Snapshot
from tasks.growing_curve import KEY, GrowingCurve

POINTS = [Snapshot(40, 1.0, 0.9, 21.125), Snapshot(90, 2.0, 1.8, None)]


def shown() -> list[str]:
    wanted = ArtifactFilter(key=ArtifactFilterKey(any_=[KEY]))
    return [a.data for a in get_client(sync_client=True).read_artifacts(artifact_filter=wanted)]


def test_one_artifact_grows_with_each_point(prefect_server):
    texts = []

    @task
    def optimising():
        curve = GrowingCurve(Seconds(10.0, 20.0))
        before = len(shown())
        for count in (1, 2):
            curve.show(POINTS[:count])
            assert len(shown()) == before + 1
            texts.append(next(text for text in shown() if "| 11.0 | 20.9 | 40 | 21.1" in text))

    @flow
    def run():
        optimising()

    run()
    assert texts[1].startswith(texts[0])
    assert texts[1].splitlines()[-1] == "| 12.0 | 21.8 | 90 |  |"


def test_outside_of_a_task_there_is_no_page():
    GrowingCurve(Seconds()).show(POINTS)
