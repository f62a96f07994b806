"""The SQL of workers: what they say to the database while they claim, renew, finish, fail, release and stream.

`python -m tests.support.statements` writes it down for the newest migration; done once a release, so that the next one
can be held to it (docs/how-to/deployment.md).
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy import event

from marey.db import create_engine, transaction, upgrade
from marey.embedded import start_postgres
from marey.jobs import ItemFailure, WorkerHeartbeat, beat, fail_items, heartbeat, leased_items, release, retire
from marey.streams import (
    NewStream,
    StreamChunk,
    StreamState,
    add_chunk,
    create_stream,
    end_stream,
    open_streams,
    take_stream,
)
from marey.tenants import DEFAULT_TENANT, create_key
from tests.servers.jobs import PROBLEM, claim_some, commit_all, new_item, parse_texts, submit_items
from tests.support.marey import REPOSITORY

FOLDER = REPOSITORY / "tests" / "integration" / "upgrading" / "statements"
SAVEPOINT = re.compile(r"(RELEASE |ROLLBACK TO )?SAVEPOINT ")
PARAMETER = re.compile(r"%\((\w+)\)s")


def as_prepared(statement: str) -> str:
    """With `$1` for psycopg's `%(name)s`."""
    numbers: dict[str, int] = {}
    numbered = PARAMETER.sub(lambda found: f"${numbers.setdefault(found[1], len(numbers) + 1)}", statement)
    return " ".join(numbered.replace("%%", "%").split())


@contextmanager
def recording(engine: sa.Engine, statements: set[str]) -> Iterator[None]:
    """Add every statement of the block."""

    def keep(_c: Any, _cursor: Any, statement: str, *_: Any) -> None:
        if not SAVEPOINT.match(statement):
            statements.add(as_prepared(statement))

    event.listen(engine, "before_cursor_execute", keep)
    yield
    event.remove(engine, "before_cursor_execute", keep)


def work(engine: sa.Engine) -> set[str]:
    """All that workers say; what is submitted to them is not theirs."""
    said: set[str] = set()
    submit_items(engine, [new_item(k, name=f"take {k}", tags=("show=one",)) for k in range(8)], fail_early=0.5)
    with recording(engine, said):
        with transaction(engine) as conn:
            beat(conn, WorkerHeartbeat("w", "hgm3", "host", 7, "cpu", "tiny@0", "batch of tiny@0"))
        parse_texts(engine)
        held = claim_some(engine, limit=3, prefer_batch_key="batch of tiny@0")
        with transaction(engine) as conn:
            heartbeat(conn, held.lease_token, [item.id for item in held.items], progressed=True)
            leased_items(conn, held.lease_token)
        commit_all(engine, held, [held.items[0].id])
        with transaction(engine) as conn:
            fail_items(conn, held.lease_token, [ItemFailure(held.items[1].id, PROBLEM, retryable=True)])
            release(conn, held.lease_token, "the worker stops")
        held = claim_some(engine, limit=6)
        with transaction(engine) as conn:
            problems = [ItemFailure(item.id, PROBLEM, retryable=False) for item in held.items[:5]]
            fail_items(conn, held.lease_token, problems)
    with transaction(engine) as conn:
        key = create_key(conn, "live", ["submit"]).key.id
        new = NewStream(DEFAULT_TENANT, key, "walk", "stroller", "m@0", 1, 9)
        streams = [create_stream(conn, new, limit=9) for _ in range(2)]
    with recording(engine, said), transaction(engine) as conn:
        open_streams(conn, "m@0")
        for stream in streams:
            take_stream(conn, stream, 1, "live worker")
            add_chunk(conn, stream, 1, StreamChunk(0, 2, b"\0" * 8, [(0, "walk")], "1-0", StreamState.LIVE))
        clip = new_item(0, "walk", model="stroller", text_key="stream-1")
        end_stream(conn, streams[0], 1, "stopped", clip=(clip, b"recording"))
        end_stream(conn, streams[1], 1, "broken", problem=PROBLEM)
        retire(conn, "w")
    return said


def main() -> None:
    """Write the statements of this version."""
    with tempfile.TemporaryDirectory(prefix="marey-") as home, start_postgres(Path(home), durable=False) as server:
        engine = create_engine(server.url)
        upgrade(engine)
        with engine.connect() as conn:
            revision = conn.execute(sa.text("SELECT version_num FROM alembic_version")).scalar_one()
        said = sorted(work(engine))
        engine.dispose()
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{revision}.sql").write_text("".join(f"{statement};\n" for statement in said), encoding="utf-8")


if __name__ == "__main__":
    main()
