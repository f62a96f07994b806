"""Postgres and Redis as Debian packages them, in the oldest versions that Marey runs on, where they are installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psycopg
import redis

from marey.core.versions import POSTGRES
from tests.servers.ports import free_ports

POSTGRES_PROGRAMS = Path(f"/usr/lib/postgresql/{POSTGRES}/bin")
REDIS_PROGRAM = shutil.which("redis-server")
INSTALLED = (POSTGRES_PROGRAMS / "initdb").exists() and REDIS_PROGRAM is not None
START_SECONDS = 30.0


@contextmanager
def debian_postgres() -> Iterator[str]:
    """Serve a new cluster; the URL of its superuser."""
    user = "postgres" if os.geteuid() == 0 else None  # Postgres refuses to run as root
    folder = Path(tempfile.mkdtemp(prefix="marey-pg-"))
    if user is not None:
        shutil.chown(folder, user)
    (port,) = free_ports(1)
    init = [POSTGRES_PROGRAMS / "initdb", "-D", folder / "data", "-A", "trust", "-U", "marey", "--no-sync"]
    subprocess.run(init, user=user, check=True, capture_output=True, cwd=folder)
    options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={folder} -c fsync=off"
    server = subprocess.Popen(
        [POSTGRES_PROGRAMS / "postgres", "-D", folder / "data", *options.split()],
        user=user,
        cwd=folder,
        stderr=subprocess.DEVNULL,
    )
    try:
        url = f"postgresql+psycopg://marey@127.0.0.1:{port}/postgres"
        _wait(lambda: psycopg.connect(url.replace("+psycopg", ""), connect_timeout=2).close(), psycopg.OperationalError)
        yield url
    finally:
        server.terminate()
        server.wait(20)
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def debian_redis() -> Iterator[str]:
    """Serve an empty Redis; its URL."""
    assert REDIS_PROGRAM is not None
    (port,) = free_ports(1)
    options = f"--port {port} --bind 127.0.0.1 --maxmemory-policy noeviction --appendonly no".split()
    command = [REDIS_PROGRAM, *options, "--save", ""]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=tempfile.gettempdir())
    try:
        url = f"redis://127.0.0.1:{port}"
        with redis.Redis.from_url(url) as client:
            _wait(client.ping, redis.RedisError)
        yield url
    finally:
        server.terminate()
        server.wait(20)


def _wait(answers: object, error: type[Exception]) -> None:
    assert callable(answers)
    deadline = time.monotonic() + START_SECONDS
    while True:
        try:
            answers()
            return
        except error:
            assert time.monotonic() < deadline
            time.sleep(0.05)
