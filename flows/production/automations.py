"""What the server does by itself: end runs whose process is gone, tell people of bad nights."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from prefect.client.orchestration import SyncPrefectClient
from prefect.events.schemas.automations import AutomationCore
from prefect.exceptions import ObjectNotFound

from flows.production.settings import BLOCK


def make_automation(client: SyncPrefectClient, content: dict[str, Any]) -> None:
    """Make it, or change the one of its name. Raises ValidationError for one that is none."""
    wanted = AutomationCore.model_validate(content)
    body = wanted.model_dump(mode="json", exclude_unset=True)
    found = _named(client, wanted.name)
    if found:
        client.request("PUT", "/automations/{id}", path_params={"id": found[0]}, json=body)
    else:
        client.request("POST", "/automations/", json=body)


def make_notifications(client: SyncPrefectClient, contents: Sequence[dict[str, Any]]) -> str:
    """Let the block that the environment names tell of what they wait for; say who is told.

    Where it names none, there are none afterwards; where it names one that the server does not
    have, they stay as they are.
    """
    name = os.environ.get(BLOCK)
    if not name:
        for content in contents:
            for found in _named(client, content["name"]):
                client.request("DELETE", "/automations/{id}", path_params={"id": found})
        return f"nobody is told of failures and regressions: set {BLOCK} and deploy again"
    block = _block_id(client, name)
    if block is None:
        return (
            f"who is told of failures and regressions stays as it was: {BLOCK} is {name}, and the "
            "server has no such block: make it on the page Blocks and deploy again"
        )
    for content in contents:
        actions = [{**action, "block_document_id": block} for action in content["actions"]]
        make_automation(client, {**content, "actions": actions})
    return f"failures and regressions are told through {name}"


def _named(client: SyncPrefectClient, name: str) -> list[str]:
    asked = {"automations": {"name": {"any_": [name]}}}
    found = client.request("POST", "/automations/filter", json=asked).json()
    return [automation["id"] for automation in found]


def _block_id(client: SyncPrefectClient, name: str) -> str | None:
    """Of a block that is named as ``slack-webhook/ops``."""
    kind, _, own = name.partition("/")
    with suppress(ObjectNotFound):
        if own:
            return str(client.read_block_document_by_name(own, kind).id)
    return None
