"""Asset stores that can be taken away and be full: a folder, a folder on a small disk of its own, a bucket."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from marey.storage import FolderStore
from marey.storage.port import AssetStore
from tests.servers.stalling_proxy import StallingProxy
from tests.servers.swift import ACCESS_KEY, SECRET_KEY, Swift

ROOM = 40 * 4096
"""Bytes that are left when a store runs full."""


class Place(Protocol):
    """Where assets lie, and what can happen to that."""

    @property
    def environment(self) -> dict[str, str]: ...
    @property
    def store(self) -> AssetStore: ...
    @property
    def proxy(self) -> StallingProxy | None:
        """The way of the processes to it, if that is a network that can fall silent."""
        ...

    def away(self) -> AbstractContextManager[None]:
        """It does not answer inside the block."""
        ...

    def full(self) -> AbstractContextManager[None]:
        """Inside the block it has room for a few files more, and then for none."""
        ...


@dataclass
class Folder:
    """A folder store that can be taken away: its root, a link, then leads to a file."""

    root: Path

    def __post_init__(self) -> None:
        self._lead_to("data").mkdir(parents=True)

    @property
    def environment(self) -> dict[str, str]:
        return {"MAREY_STORE": str(self.root)}

    @property
    def store(self) -> AssetStore:
        return FolderStore(self.root)

    @property
    def proxy(self) -> StallingProxy | None:
        return None

    @contextmanager
    def away(self) -> Iterator[None]:
        self._lead_to("nothing").touch()
        try:
            yield
        finally:
            self._lead_to("data")

    def _lead_to(self, name: str) -> Path:
        """In one step: a writer between two would make a folder there."""
        self.root.parent.mkdir(exist_ok=True)
        link = self.root.with_name("link")
        link.symlink_to(name)
        link.replace(self.root)
        return self.root.with_name(name)


@dataclass
class Disk(Folder):
    """The same on a disk of its own (tmpfs), whose end a write meets as ENOSPC."""

    @classmethod
    @contextmanager
    def mounted(cls, folder: Path, size: int) -> Iterator[Disk]:
        """A disk of so many bytes on `folder`.

        Raises:
            PermissionError: this process may not mount.
        """
        folder.mkdir()
        made = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size},mode=0700", "tmpfs", folder],
            capture_output=True,
            text=True,
            check=False,
        )
        if made.returncode != 0:
            raise PermissionError(made.stderr.strip())
        try:
            yield cls(folder / "assets")
        finally:
            subprocess.run(["umount", "--lazy", folder], check=True)

    @contextmanager
    def full(self) -> Iterator[None]:
        ballast = self.root.parent / "ballast"
        with ballast.open("wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(ROOM))
            except OSError:  # ENOSPC
                file.truncate(max(0, file.tell() - ROOM))
        try:
            yield
        finally:
            ballast.unlink()


@dataclass
class S3:
    """A bucket of a server that can be taken away and has a byte limit of its own.

    Attributes:
        proxy: by which the processes reach it; the tests do not. None = they reach it directly.
    """

    server: Swift
    proxy: StallingProxy | None = None

    @classmethod
    @contextmanager
    def proxied(cls, server: Swift) -> Iterator[S3]:
        """A bucket that the processes reach through a proxy that can fall silent."""
        host, port = server.endpoint.split(":")
        with StallingProxy((host, int(port))) as proxy:
            yield cls(server, proxy)

    def __post_init__(self) -> None:
        self._store = self.server.new_store()

    @property
    def store(self) -> AssetStore:
        return self._store

    @property
    def environment(self) -> dict[str, str]:
        return {
            "MAREY_STORE": f"s3://{self._store.options.bucket}",
            "MAREY_S3_ENDPOINT": self.server.endpoint if self.proxy is None else f"127.0.0.1:{self.proxy.port}",
            "MAREY_S3_ACCESS_KEY": ACCESS_KEY,
            "MAREY_S3_SECRET_KEY": SECRET_KEY,
        }

    @contextmanager
    def away(self) -> Iterator[None]:
        self.server.stop()
        try:
            yield
        finally:
            self.server.start()

    @contextmanager
    def full(self) -> Iterator[None]:
        bucket = self._store.options.bucket
        self.server.limit(bucket, ROOM)
        try:
            yield
        finally:
            self.server.limit(bucket, None)
