"""An S3 server on this machine for the tests, and a way to make it fail."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import s3fs
from moto.server import ThreadedMotoServer

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
def object_storage() -> Iterator[ObjectStorage]:
    """Serves on loopback for as long as the block lasts."""
    server = ThreadedMotoServer("127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    try:
        yield ObjectStorage(f"http://{host}:{port}")
    finally:
        server.stop()
