"""PgBouncer in front of a Postgres, for tests of what works behind a pooler."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import psycopg
import sqlalchemy as sa

from tests.servers.ports import free_ports
from tests.servers.stalling_proxy import StallingProxy

PROGRAM = shutil.which("pgbouncer")


@contextmanager
def pooler(folder: Path, database_url: str, mode: Literal["session", "transaction"], *, size: int = 4) -> Iterator[str]:
    """Run PgBouncer; the address of the database through it.

    Args:
        folder: an empty one, for its configuration.
        size: sessions of Postgres that its clients share.
    """
    assert PROGRAM is not None
    url = sa.make_url(database_url)
    (port,) = free_ports(1)
    # PgBouncer runs as another user than the owner of the socket's folder: a proxy lets it in by TCP.
    with StallingProxy(f"{url.query['host']}/.s.PGSQL.5432") as proxy:
        (folder / "users.txt").write_text(f'"{url.username}" ""\n')
        (folder / "pgbouncer.ini").write_text(
            f"""
            [databases]
            {url.database} = host=127.0.0.1 port={proxy.port} user={url.username}
            [pgbouncer]
            listen_addr = 127.0.0.1
            listen_port = {port}
            unix_socket_dir =
            auth_type = any
            pool_mode = {mode}
            default_pool_size = {size}
            """
        )
        account = pwd.getpwnam("nobody") if os.geteuid() == 0 else None
        folder.chmod(0o755)
        with (folder / "pgbouncer.log").open("wb") as log:
            process = subprocess.Popen(
                [PROGRAM, folder / "pgbouncer.ini"],
                stdout=log,
                stderr=log,
                user=None if account is None else account.pw_uid,
            )
            try:
                address = url.set(host="127.0.0.1", port=port, query={}).render_as_string(hide_password=False)
                _wait(address, process)
                yield address
            finally:
                process.kill()
                process.wait()


def _wait(address: str, process: subprocess.Popen[bytes]) -> None:
    dsn = sa.make_url(address).set(drivername="postgresql").render_as_string(hide_password=False)
    for _ in range(100):
        try:
            psycopg.connect(dsn, connect_timeout=5).close()
        except psycopg.OperationalError:
            assert process.poll() is None, "PgBouncer ended"
            try:
                process.wait(0.1)
            except subprocess.TimeoutExpired:
                continue
        else:
            return
    raise AssertionError("PgBouncer does not answer")
