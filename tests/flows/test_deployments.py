"""The deployments that prefect.yaml names can be loaded and take the parameters they are given."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from prefect.flows import load_flow_from_entrypoint

ROOT = Path(__file__).parents[2]
DEPLOYMENTS = yaml.safe_load((ROOT / "deployments" / "prefect.yaml").read_text())["deployments"]


FLOWS = {
    "full": "mocoflow",
    "fast": "mocoflow",
    "synthetic": "benchmark",
    "nightly": "stability",
}


def test_all_deployments_are_there():
    assert [deployment["name"] for deployment in DEPLOYMENTS] == list(FLOWS)


@pytest.mark.parametrize("deployment", DEPLOYMENTS, ids=lambda d: d["name"])
def test_a_deployment_loads_and_its_parameters_are_valid(deployment):
    flow = load_flow_from_entrypoint(deployment["entrypoint"])
    assert flow.name == FLOWS[deployment["name"]]
    flow.validate_parameters(deployment["parameters"])
