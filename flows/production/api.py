"""Questions to a Prefect server, without the seconds that importing its client takes."""

from __future__ import annotations

import base64
import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from flows.production.site import AUTHENTICATION


def ask(api: str, path: str, body: dict[str, Any] | None = None, method: str | None = None) -> Any:  # noqa: ANN401
    """The answer to one question, with the user's password where one is set.

    Raises OSError where the server is away or refuses.
    """
    content = None if body is None else json.dumps(body).encode()
    return _answer(Request(api + path, content, method=method), os.environ.get(AUTHENTICATION))


def answers(api: str) -> bool:
    """Whether a server is there whose database answers, too."""
    with suppress(OSError, ValueError):
        return _answer(Request(f"{api}/ready"), None) == {"message": "OK"}
    return False


def admits(api: str, secret: str | None) -> bool:
    """Whether a running server answers who comes with this password, or with none."""
    try:
        _answer(Request(f"{api}/admin/version"), secret)
    except HTTPError as error:
        if error.code != HTTPStatus.UNAUTHORIZED:
            raise
        return False
    return True


def _answer(request: Request, secret: str | None) -> Any:  # noqa: ANN401
    request.add_header("Content-Type", "application/json")
    if secret:
        encoded = base64.b64encode(secret.encode()).decode()
        request.add_header("Authorization", f"Basic {encoded}")
    with urlopen(request, timeout=30.0) as answer:
        return json.loads(answer.read() or b"null")


def wait_for(what: Callable[[], bool], within_s: float) -> bool:
    """Whether something becomes true in time."""
    end = time.monotonic() + within_s
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(0.3)
    return True
