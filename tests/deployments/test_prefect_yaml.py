"""The deployments that prefect.yaml names can be loaded and take the parameters they are given."""

from __future__ import annotations

import asyncio
from pathlib import Path
from unittest.mock import Mock
from uuid import uuid4

import pytest
import yaml
from prefect.events.schemas.automations import AutomationCore
from prefect.exceptions import ParameterTypeError
from prefect.flows import load_flow_from_entrypoint
from prefect.schedules import Cron
from prefect.utilities.schema_tools.validation import validate
from prefect.workers.process import ProcessJobConfiguration

from flows.data_set_roots import ROOTS
from flows.regression_event import EVENT

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


NOTIFICATIONS = yaml.safe_load((FOLDER / "notifications.yaml").read_text())["automations"]


@pytest.mark.parametrize("content", NOTIFICATIONS, ids=lambda content: content["name"])
def test_a_notification_is_an_automation_once_it_has_a_block(content):
    actions = [{**action, "block_document_id": str(uuid4())} for action in content["actions"]]
    AutomationCore.model_validate({**content, "actions": actions})


def test_people_are_told_of_the_event_that_a_benchmark_emits():
    assert EVENT in {event for content in NOTIFICATIONS for event in content["trigger"]["expect"]}


@pytest.mark.parametrize("deployment", DEPLOYMENTS, ids=lambda d: d["name"])
def test_scheduled_benchmarks_measure_everything_again(deployment):
    if "benchmark" in deployment["tags"]:
        assert deployment["parameters"]["afresh"]


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
    assert {q["name"]: q["concurrency_limit"] for q in POOL["queues"]}["by-clock"] == 1


@pytest.mark.parametrize("deployment", DEPLOYMENTS, ids=lambda d: d["name"])
def test_no_run_holds_a_lease_that_ends_it_when_the_server_has_forgotten_it(deployment):
    assert "concurrency_limit" not in deployment


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
        ("flows.reconstruct.reconstruct", {"rendezvous": "gpu0"}),
        ("flows.benchmark.benchmark", {"presets": ["turbo"]}),
        ("flows.benchmark.benchmark", {"methods": ["magic"]}),
        ("flows.benchmark.benchmark", {"experiment": "magic"}),
        ("flows.benchmark.benchmark", {"targets": ["psnr"]}),
        ("flows.benchmark.benchmark", {"targets": ["beauty=1"]}),
        ("flows.benchmark.benchmark", {"workers": 0}),
        ("flows.benchmark.benchmark", {"workers": 10**6}),
        ("flows.benchmark.benchmark", {"dask": "somewhere"}),
        ("flows.benchmark.benchmark", {"slots": ""}),
        ("flows.stability.stability", {"areas": ["weather"]}),
    ],
    ids=lambda value: str(value),
)
def test_a_parameter_out_of_its_bounds_is_no_valid_one(entrypoint, parameters):
    flow = load_flow_from_entrypoint(entrypoint)
    with pytest.raises(ParameterTypeError):
        flow.validate_parameters(parameters)
    assert refused_by_the_server(flow, parameters)


@pytest.mark.parametrize(
    ("entrypoint", "parameters"),
    [
        ("flows.reconstruct.reconstruct", {"machines": 2, "rendezvous": "gpu0:29400"}),
        ("flows.reconstruct.reconstruct", {"rendezvous": "[fd00::1]:29400", "until": None}),
        ("flows.benchmark.benchmark", {"methods": ["mocoflow", "without_box", "posed_mesh"]}),
        ("flows.benchmark.benchmark", {"methods": ["base", "with_moco"], "experiment": None}),
        ("flows.benchmark.benchmark", {"methods": [], "experiment": "misalignment"}),
        ("flows.benchmark.benchmark", {"targets": [" psnr_union = +2e1 ", "lpips_alex=.1"]}),
        ("flows.benchmark.benchmark", {"dask": "127.0.0.1:8786", "slots": "GPU 0"}),
        ("flows.benchmark.benchmark", {"dask": "tls://[::1]:8786"}),
        ("flows.stability.stability", {"areas": ["se3", "mesh"]}),
    ],
    ids=lambda value: str(value),
)
def test_what_a_command_line_takes_is_valid(entrypoint, parameters):
    flow = load_flow_from_entrypoint(entrypoint)
    flow.validate_parameters(parameters)
    assert not refused_by_the_server(flow, parameters)


def refused_by_the_server(flow, parameters):
    """What the server finds wrong before it makes a run."""
    schema = flow.parameters.model_dump()
    return validate(parameters, schema, ignore_required=True, allow_none_with_default=True)


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
