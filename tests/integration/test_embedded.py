"""The embedded servers: own, private, durable, gone with their owner."""

from __future__ import annotations

import os
import pwd
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import psycopg
import pytest
import redis

from marey import embedded
from marey.core.errors import Conflict, InvalidInput
from marey.embedded import (
    SOCKET_LIMIT,
    EmbeddedServer,
    StartFailed,
    postgres_url,
    socket_folder,
    start_valkey,
    valkey_url,
)

OWNER = """
import sys, time
from pathlib import Path
from marey.embedded import start_postgres, start_valkey
servers = [start_postgres(Path(sys.argv[1]), durable=False), start_valkey(Path(sys.argv[1]))]
print(*(server.process.pid for server in servers), flush=True)
time.sleep(600)
"""


def start_postgres(home: Path) -> EmbeddedServer:
    """Without fsync: what survives a killed process does so without it."""
    return embedded.start_postgres(home, durable=False)


def sql(server: EmbeddedServer, statement: str) -> list[tuple[object, ...]]:
    with psycopg.connect(server.url.replace("+psycopg", ""), autocommit=True) as connection:
        cursor = connection.execute(statement.encode())
        return cursor.fetchall() if cursor.description else []


def valkey_client(home: Path) -> redis.Redis:
    return redis.Redis(unix_socket_path=str(socket_folder(home) / "valkey.sock"), decode_responses=True)


def owner_of(home: Path, *as_user: str) -> tuple[subprocess.Popen[str], list[int]]:
    """A process that starts both servers and waits."""
    owner = subprocess.Popen(
        [*as_user, sys.executable, "-c", OWNER, str(home)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).resolve().parents[2],
    )
    assert owner.stdout is not None
    return owner, [int(pid) for pid in owner.stdout.readline().split()]


def gone(pids: list[int], seconds: float = 10) -> bool:
    """Return True if these processes end in time (a zombie has ended)."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        left = [pid for pid in pids if psutil.pid_exists(pid)]
        if all(psutil.Process(pid).status() == psutil.STATUS_ZOMBIE for pid in left):
            return True
        time.sleep(0.02)
    return False


def test_data_survives_a_stop_and_a_crash(short_home: Path) -> None:
    with start_postgres(short_home) as server:
        assert server.url == postgres_url(short_home)
        sql(server, "CREATE TABLE kept (n int)")
        sql(server, "INSERT INTO kept VALUES (1)")
    server = start_postgres(short_home)
    sql(server, "INSERT INTO kept VALUES (2)")
    server.kill()
    assert not server.alive()
    with start_postgres(short_home) as server:
        assert sql(server, "SELECT n FROM kept ORDER BY n") == [(1,), (2,)]


def test_the_queue_survives_a_stop(short_home: Path) -> None:
    with start_valkey(short_home) as server:
        assert server.url == valkey_url(short_home)
        with valkey_client(short_home) as client:
            client.rpush("queue", "a", "b")
    with start_valkey(short_home), valkey_client(short_home) as client:
        assert client.lrange("queue", 0, -1) == ["a", "b"]
        assert client.config_get("maxmemory-policy") == {"maxmemory-policy": "noeviction"}


def test_both_die_with_an_owner_that_is_killed_and_start_again(short_home: Path) -> None:
    owner, pids = owner_of(short_home)
    assert all(psutil.pid_exists(pid) for pid in pids)
    owner.kill()
    owner.communicate()
    assert gone(pids)
    with start_postgres(short_home) as postgres, start_valkey(short_home) as valkey:
        assert sql(postgres, "SELECT 1") == [(1,)]
        assert valkey.alive()


def test_a_server_left_running_is_stopped_before_a_new_one_starts(short_home: Path) -> None:
    """The state left by a kernel without the parent-death signal."""
    first = [start_postgres(short_home), start_valkey(short_home)]
    for server in first:
        server._unlock()  # pyright: ignore[reportPrivateUsage]  # as if the owner had died
    with start_postgres(short_home) as postgres, start_valkey(short_home) as valkey:
        assert [server.process.wait(5) is not None for server in first] == [True, True]
        assert sql(postgres, "SELECT 1") == [(1,)]
        assert valkey.alive()


@pytest.mark.parametrize("start", [start_postgres, start_valkey])
def test_a_second_owner_is_told_who_runs_it(short_home: Path, start: Callable[[Path], EmbeddedServer]) -> None:
    with start(short_home) as server:
        with pytest.raises(Conflict, match=rf"pid {os.getpid()}"):
            start(short_home)
        assert server.alive()


def test_two_homes_have_two_servers_that_know_nothing_of_each_other(short_home: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    with start_postgres(short_home) as first, start_postgres(other) as second:
        sql(first, "CREATE TABLE mine (n int)")
        assert sql(second, "SELECT 1 FROM pg_tables WHERE tablename = 'mine'") == []
    with start_valkey(short_home), start_valkey(other):
        with valkey_client(short_home) as client:
            client.set("mine", "1")
        with valkey_client(other) as client:
            assert client.get("mine") is None


def test_a_home_with_a_long_path_gets_short_sockets(short_home: Path) -> None:
    home = short_home / ("long" * 30)
    assert len(os.fsencode(socket_folder(home) / ".s.PGSQL.5432")) < SOCKET_LIMIT
    assert socket_folder(home).parent != home
    with start_postgres(home) as server:
        assert sql(server, "SELECT 1") == [(1,)]
    socket_folder(home).rmdir()


def test_nobody_else_reaches_the_servers(short_home: Path) -> None:
    with start_postgres(short_home) as postgres, start_valkey(short_home):
        for path in (short_home, short_home / "postgres", short_home / "valkey", socket_folder(short_home)):
            assert stat.S_IMODE(path.stat().st_mode) == 0o700, path
        assert sql(postgres, "SHOW listen_addresses") == [("",)]
        with valkey_client(short_home) as client:
            assert client.config_get("port") == {"port": "0"}


def test_a_folder_laid_as_a_trap_is_refused(short_home: Path) -> None:
    (short_home / "elsewhere").mkdir()
    socket_folder(short_home).symlink_to(short_home / "elsewhere")
    with pytest.raises(Conflict, match="belongs to another user"):
        start_valkey(short_home)


@pytest.mark.parametrize("start", [start_postgres, start_valkey])
def test_a_home_that_cannot_be_written_is_told(short_home: Path, start: Callable[[Path], EmbeddedServer]) -> None:
    (short_home / "file").write_text("not a folder")
    with pytest.raises(InvalidInput, match="MAREY_HOME"):
        start(short_home / "file" / "home")


def test_a_cluster_of_another_version_is_refused_with_a_way_out(short_home: Path) -> None:
    start_postgres(short_home).stop()
    (short_home / "postgres" / "PG_VERSION").write_text("16\n")
    with pytest.raises(StartFailed, match="Postgres 16") as caught:
        start_postgres(short_home)
    assert caught.value.hint is not None
    assert "MAREY_HOME" in caught.value.hint
    (short_home / "postgres" / "PG_VERSION").write_text("18\n")
    start_postgres(short_home).stop()


def test_a_server_that_does_not_start_shows_its_log(short_home: Path) -> None:
    start_postgres(short_home).stop()
    with (short_home / "postgres" / "postgresql.conf").open("a") as file:
        file.write("nonsense = on\n")
    with pytest.raises(StartFailed) as caught:
        start_postgres(short_home)
    assert caught.value.hint is not None
    assert "nonsense" in caught.value.hint


def test_a_client_of_a_server_that_was_killed_gets_an_error_not_silence(short_home: Path) -> None:
    server = start_postgres(short_home)
    with psycopg.connect(server.url.replace("+psycopg", ""), autocommit=True) as connection:
        server.kill()
        with pytest.raises(psycopg.OperationalError):
            connection.execute("SELECT 1")
    with pytest.raises(OSError), socket.socket(socket.AF_UNIX) as attempt:  # noqa: PT011
        attempt.connect(str(socket_folder(short_home) / ".s.PGSQL.5432"))


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can start a process as another user")
def test_an_ordinary_user_runs_both(short_home: Path) -> None:
    user = pwd.getpwnam("nobody")
    os.chown(short_home, user.pw_uid, user.pw_gid)
    # May pass closed folders: the interpreter may lie below one of root's.
    as_user = ["setpriv", f"--reuid={user.pw_uid}", f"--regid={user.pw_gid}", "--clear-groups"]
    owner, pids = owner_of(short_home, *as_user, "--inh-caps=+dac_override", "--ambient-caps=+dac_override")
    try:
        assert [psutil.Process(pid).uids().real for pid in pids] == [user.pw_uid] * 2
    finally:
        owner.send_signal(signal.SIGKILL)
        owner.communicate()
    assert gone(pids)


@pytest.mark.skipif(os.geteuid() != 0, reason="is about root")
def test_root_runs_postgres_as_another_user_below_a_folder_closed_to_it(short_home: Path) -> None:
    home = short_home / "closed" / "home"
    home.parent.mkdir(mode=0o700)
    with start_postgres(home) as server:
        assert psutil.Process(server.process.pid).uids().real != 0
        assert sql(server, "SELECT 1") == [(1,)]
    assert stat.S_IMODE(home.parent.stat().st_mode) == 0o700
