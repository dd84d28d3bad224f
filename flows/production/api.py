"""Questions to a Prefect server, without the seconds that importing its client takes."""

from __future__ import annotations

import base64
import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from urllib.error import URLError
from urllib.request import Request, urlopen

from flows.production.site import AUTHENTICATION


def ask(api: str, path: str, body: dict[str, Any] | None = None) -> Any:  # noqa: ANN401
    """The answer to one question, with the user's password where the server has one."""
    headers = {"Content-Type": "application/json"}
    if secret := os.environ.get(AUTHENTICATION):
        headers["Authorization"] = f"Basic {base64.b64encode(secret.encode()).decode()}"
    content = None if body is None else json.dumps(body).encode()
    with urlopen(Request(api + path, content, headers), timeout=30.0) as answer:
        return json.loads(answer.read() or b"null")


def answers(api: str) -> bool:
    """Whether a healthy server is there."""
    with suppress(URLError, OSError, ValueError):
        return ask(api, "/health") is True
    return False


def wait_for(what: Callable[[], bool], within_s: float) -> bool:
    """Whether something becomes true in time."""
    end = time.monotonic() + within_s
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(0.3)
    return True
