"""A relay before a Prefect server that counts what passes: requests by route, bytes both ways."""

from __future__ import annotations

import asyncio
import re
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_REQUEST = re.compile(rb"^(GET|POST|PATCH|PUT|DELETE) (\S+) HTTP/1\.1\r\n")
_ID = re.compile(r"[0-9a-f]{8}-[0-9a-f-]{27,}|[0-9a-f]{32}")


class Traffic:
    """What has passed so far."""

    def __init__(self) -> None:
        self.requests: Counter[str] = Counter()
        self.up_bytes = 0
        self.down_bytes = 0
        self.port = 0

    def _saw(self, chunk: bytes) -> None:
        self.up_bytes += len(chunk)
        request = _REQUEST.match(chunk)
        if request:
            path = request[2].decode().partition("?")[0]
            self.requests[f"{request[1].decode()} {_ID.sub('ID', path)}"] += 1


@contextmanager
def counting_proxy(server_port: int) -> Iterator[Traffic]:
    """Relay a free port of loopback to the server's; give what passes."""
    traffic, loop, ready = Traffic(), asyncio.new_event_loop(), threading.Event()

    async def begin() -> None:
        server = await asyncio.start_server(
            lambda ours, theirs: _relay(ours, theirs, server_port, traffic), "127.0.0.1", 0
        )
        traffic.port = server.sockets[0].getsockname()[1]
        ready.set()

    def run() -> None:
        loop.create_task(begin())
        loop.run_forever()

    threading.Thread(target=run, daemon=True).start()
    ready.wait()
    try:
        yield traffic
    finally:
        loop.call_soon_threadsafe(loop.stop)


async def _relay(
    client: asyncio.StreamReader, answer: asyncio.StreamWriter, port: int, traffic: Traffic
) -> None:
    server, question = await asyncio.open_connection("127.0.0.1", port)

    async def up() -> None:
        while chunk := await client.read(1 << 20):
            traffic._saw(chunk)
            question.write(chunk)
            await question.drain()
        question.close()

    async def down() -> None:
        while chunk := await server.read(1 << 20):
            traffic.down_bytes += len(chunk)
            answer.write(chunk)
            await answer.drain()
        answer.close()

    with suppress(ConnectionError):
        await asyncio.gather(up(), down())
