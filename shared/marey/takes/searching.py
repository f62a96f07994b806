"""Search among a million motions: two query plans, each forced, since the planner would choose badly.

`motion_search` has a row per motion, and its `terms` cover all filters. A page is searched

1. newest first, among the next `WALKED` motions: fast for a filter that matches often;
2. through the index of terms, which intersects all conditions of the filter, however old the matches; only those
   rows are sorted. The matches are either rare, or older than all walked ones.

The cost is bounded by the walk plus the matching rows, independent of the table size. Without statistics (after a
bulk load), or with old ones, the planner would walk the primary key or read the whole table instead: so each
statement runs with settings that leave it one plan.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import TSQUERY

from marey.db.pages import Order
from marey.db.sql import check_text
from marey.jobs import tables
from marey.takes.types import MotionFilter

WALKED = 20_000
"""Motions walked in order before the index is used: about 10 ms."""
UNREVIEWED = "new"
VARIANTS = 1000
"""Maximum motions of one prompt, by its index."""

_PLAIN = {"jit": "off", "max_parallel_workers_per_gather": "0", "work_mem": "32MB"}
_SWITCHES = ("seqscan", "indexscan", "indexonlyscan", "bitmapscan", "sort", "hashjoin", "mergejoin")
_WALK = ("indexscan",)
_LOOK_UP = ("bitmapscan", "sort")
_FETCH = ("indexscan", "indexonlyscan", "bitmapscan", "sort")


def find_motions(
    conn: sa.Connection, tenant: str, found: MotionFilter, *, job: UUID | None, cursor: str | None, limit: int
) -> list[UUID]:
    """Return ids of the motions that match a filter: of a job in creation order; of the whole tenant newest first.

    Raises:
        InvalidInput: a filter with forbidden characters, or a cursor of another listing.
    """
    table = tables.motion_search.c
    order = Order(table.created_at, table.motion_id, descending=job is None)
    ours = table.tenant_id == tenant if job is None else table.job_id == job
    place = None if cursor is None else order.place(cursor, ours)
    walk = sa.select(table.motion_id, table.terms).where(ours).order_by(*order.by())
    if place is not None:
        walk = walk.where(order.beyond(place))
    if not _conditions(found, table.terms):
        with _plan(conn, _WALK):
            return list(conn.execute(walk.with_only_columns(table.motion_id).limit(limit)).scalars())
    recent = walk.limit(WALKED).subquery("recent")
    query = sa.select(recent.c.motion_id).where(*_conditions(found, recent.c.terms)).limit(limit)
    with _plan(conn, _WALK):
        ids = list(conn.execute(query).scalars())
    if len(ids) == limit:
        return ids
    scope = _lexeme("t", tenant) if job is None else _lexeme("j", str(job))
    matches = (
        sa.select(table.motion_id, table.created_at)
        .where(_has(table.terms, scope), *_conditions(found, table.terms))
        .offset(0)  # optimization fence: order and page condition stay outside
        .subquery("matches")
    )
    order = Order(matches.c.created_at, matches.c.motion_id, descending=job is None)
    query = sa.select(matches.c.motion_id).order_by(*order.by()).limit(limit)
    if place is not None:
        query = query.where(order.beyond(place))
    with _plan(conn, _LOOK_UP):
        return list(conn.execute(query).scalars())


def motions_at(conn: sa.Connection, job: UUID, index: int) -> list[UUID]:
    """Return ids of the motions of one prompt of a job, by the prompt's index; several for variants."""
    table = tables.motion_search.c
    terms = (_lexeme("j", str(job)), _lexeme("x", str(index)))
    with _plan(conn, _LOOK_UP):
        query = sa.select(table.motion_id).where(*(_has(table.terms, term) for term in terms))
        return list(conn.execute(query.limit(VARIANTS)).scalars())


@contextmanager
def fetching_by_id(conn: sa.Connection) -> Generator[None]:
    """Make statements that name some ids use indexes only, independent of the statistics."""
    with _plan(conn, _FETCH):
        yield


@contextmanager
def _plan(conn: sa.Connection, allowed: Sequence[str]) -> Generator[None]:
    """Restrict the planner to these scan types until the end of the block."""
    wanted = {**_PLAIN, **{f"enable_{name}": "on" if name in allowed else "off" for name in _SWITCHES}}
    conn.exec_driver_sql("; ".join(f"SET LOCAL {name} = '{value}'" for name, value in wanted.items()))
    yield  # after an error the transaction has ended, and with it the settings
    conn.exec_driver_sql("; ".join(f"SET LOCAL {name} TO DEFAULT" for name in wanted))


def _conditions(found: MotionFilter, terms: sa.ColumnElement[Any]) -> list[sa.ColumnElement[bool]]:
    """Return the conditions of a filter separately, so that the index can intersect them."""
    for where, text in (("name", found.name), ("text", found.text), *(("tag", tag) for tag in found.tags)):
        check_text(text, where)
    wanted = [_has(terms, _lexeme("g", tag)) for tag in found.tags]
    if found.name is not None:
        begins = sa.literal("'\x01n").concat(sa.func.lower(_escaped(found.name))).concat("':*")
        wanted.append(_has(terms, begins))
    if found.text is not None:
        asked = sa.func.websearch_to_tsquery(sa.literal_column("'english'::regconfig"), found.text)
        wanted.append(terms.bool_op("@@")(asked))
    said = [*map(str, found.reviews), *([UNREVIEWED] if found.unreviewed else [])]
    if said:
        wanted.append(_has(terms, sa.literal(" | ".join(f"'\x01r{_escaped(each)}'" for each in said))))
    return wanted


def _lexeme(kind: str, value: str) -> sa.ColumnElement[str]:
    """Return a term of `tables.motion_search` as a query."""
    return sa.literal(f"'\x01{kind}{_escaped(value)}'")


def _escaped(text: str) -> str:
    """Escape text for the quotes of a tsquery."""
    return text.replace("\\", "\\\\").replace("'", "''")


def _has(terms: sa.ColumnElement[Any], query: sa.ColumnElement[str]) -> sa.ColumnElement[bool]:
    return terms.bool_op("@@")(sa.cast(query, TSQUERY))
