"""An S3 server on this machine for the tests, and a way to make it fail."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from unittest import mock

import s3fs
from moto.s3.responses import S3Response
from moto.server import ThreadedMotoServer

# When moto says that every upload of several parts has begun.
MOTOS_DATE = "2010-11-10T20:48:33.000Z"
ACCESS = {"AWS_ACCESS_KEY_ID": "tests", "AWS_SECRET_ACCESS_KEY": "tests"}


@dataclass(frozen=True)
class ObjectStorage:
    endpoint: str

    @property
    def environment(self) -> dict[str, str]:
        """What a process needs to reach it at ``s3://...``."""
        return {
            **ACCESS,
            "AWS_ENDPOINT_URL": self.endpoint,
            "AWS_DEFAULT_REGION": "us-east-1",
        }

    def files(self) -> s3fs.S3FileSystem:
        """The storage as others see it, nothing remembered."""
        return s3fs.S3FileSystem(
            key=ACCESS["AWS_ACCESS_KEY_ID"],
            secret=ACCESS["AWS_SECRET_ACCESS_KEY"],
            endpoint_url=self.endpoint,
            use_listings_cache=False,
            skip_instance_cache=True,
        )

    @contextmanager
    def uploads_begun(self, seconds_ago: float) -> Iterator[None]:
        """The server says so of every upload that is open."""
        begun = datetime.fromtimestamp(time.time() - seconds_ago, UTC)
        dated = begun.strftime("%Y-%m-%dT%H:%M:%S.000Z")
        listed = S3Response.list_multipart_uploads

        def answer(response: S3Response):
            status, headers, body = listed(response)
            assert body.count(MOTOS_DATE) == body.count("<Upload>")
            return status, headers, body.replace(MOTOS_DATE, dated)

        with mock.patch.object(S3Response, "list_multipart_uploads", answer):
            yield


@contextmanager
def object_storage() -> Iterator[ObjectStorage]:
    """Serves on loopback for as long as the block lasts."""
    server = ThreadedMotoServer("127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    try:
        yield ObjectStorage(f"http://{host}:{port}")
    finally:
        server.stop()
