"""The deployments that prefect.yaml names can be loaded and take the parameters they are given."""

from __future__ import annotations

import asyncio
from pathlib import Path
from unittest.mock import Mock

import pytest
import yaml
from prefect.events.schemas.automations import AutomationCore
from prefect.exceptions import ParameterTypeError
from prefect.flows import load_flow_from_entrypoint
from prefect.schedules import Cron
from prefect.workers.process import ProcessJobConfiguration

from flows.data_set_roots import ROOTS

FOLDER = Path(__file__).parents[2] / "deployments"
DEPLOYMENTS = yaml.safe_load((FOLDER / "prefect.yaml").read_text())["deployments"]
POOL = yaml.safe_load((FOLDER / "pool.yaml").read_text())

FLOWS = {
    "full": "mocoflow",
    "fast": "mocoflow",
    "aist": "benchmark",
    "zju-mocap": "benchmark",
    "people-snapshot": "benchmark",
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
    # Whoever gives none has a complete run.
    assert flow.parameters.required == []


@pytest.mark.parametrize("deployment", DEPLOYMENTS, ids=lambda d: d["name"])
def test_a_deployment_waits_in_a_queue_of_the_pool(deployment):
    pool = deployment["work_pool"]
    assert pool["name"] == POOL["name"]
    assert pool["work_queue_name"] in [queue["name"] for queue in POOL["queues"]]


@pytest.mark.parametrize("deployment", DEPLOYMENTS, ids=lambda d: d["name"])
def test_what_a_clock_starts_runs_one_at_a_time_and_in_its_own_queue(deployment):
    by_clock = bool(deployment["schedules"])
    assert (deployment["work_pool"]["work_queue_name"] == "by-clock") == by_clock
    for schedule in deployment["schedules"]:
        Cron(schedule["cron"], timezone=schedule["timezone"])
        assert deployment["concurrency_limit"]["limit"] == 1


@pytest.mark.parametrize("name", ROOTS)
def test_a_data_set_is_paused_and_says_what_it_waits_for(name):
    [deployment] = [found for found in DEPLOYMENTS if found["name"] == name]
    assert deployment["parameters"]["scenes"] == [name]
    assert [schedule["active"] for schedule in deployment["schedules"]] == [False]
    assert f"paused until {ROOTS[name]}" in deployment["description"]


@pytest.mark.parametrize(
    ("entrypoint", "parameters"),
    [
        ("flows.reconstruct.reconstruct", {"seed": -1}),
        ("flows.reconstruct.reconstruct", {"seed": 2**32}),
        ("flows.reconstruct.reconstruct", {"devices": 0}),
        ("flows.reconstruct.reconstruct", {"machines": 0}),
        ("flows.reconstruct.reconstruct", {"budget_s": 0}),
        ("flows.reconstruct.reconstruct", {"preset": "turbo"}),
        ("flows.reconstruct.reconstruct", {"settings": ["no value"]}),
        ("flows.reconstruct.reconstruct", {"until": "psnr=30"}),
        ("flows.benchmark.benchmark", {"seeds": 0}),
        ("flows.benchmark.benchmark", {"presets": ["turbo"]}),
    ],
    ids=lambda value: str(value),
)
def test_a_parameter_out_of_its_bounds_is_no_valid_one(entrypoint, parameters):
    with pytest.raises(ParameterTypeError):
        load_flow_from_entrypoint(entrypoint).validate_parameters(parameters)


@pytest.mark.parametrize("env", [{"env": {"MOCOFLOW_DATA_ROOTS": ""}}, {"env.A": "b"}], ids=str)
def test_who_starts_a_run_chooses_neither_its_environment_nor_its_command(env):
    asked = env | {"command": "id", "working_dir": "/etc"}
    made = asyncio.run(
        ProcessJobConfiguration.from_template_and_values(
            POOL["base_job_template"], asked, client=Mock()
        )
    )
    assert (made.env, made.command, made.working_dir) == ({}, None, None)


def test_the_automation_can_be_read_and_outlasts_some_heartbeats():
    zombies = AutomationCore.model_validate(yaml.safe_load((FOLDER / "zombies.yaml").read_text()))
    assert zombies.trigger.within.total_seconds() >= 3 * 30
