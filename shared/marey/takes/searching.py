"""Search among a million motions: two query plans, each forced, since the planner would choose badly.

`motion_search` has a row per motion, and its `terms` cover all filters. A page is searched

1. newest first, among the next `WALKED` motions: fast for a filter that matches often;
2. through the index of terms and of the first characters of names, which intersects all conditions of the filter,
   however old the matches. The matches are either rare, or older than all walked ones. First only their creation
   times are sorted, then the motions of the page's times are read: Postgres sorts a single number by value, and
   copies wider rows, which takes five times as long when every row enters the page for a while (rows come oldest
   first). Where no other tenant has motions, the times are sought without the term of the tenant: intersecting with
   the list of all motions takes a tenth more.

The cost is bounded by the walks plus the matching rows, independent of the table size. Without statistics (after a
bulk load), or with old ones, the planner would walk the primary key or read the whole table instead: so each
statement runs with settings that leave it one plan.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from typing import Any, TypeVar
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import TSQUERY, array

from marey.db.pages import Order, Place
from marey.db.sql import check_text
from marey.db.tables import Time
from marey.jobs import tables
from marey.takes.types import MotionFilter

Value = TypeVar("Value")
WALKED = 20_000
"""Motions walked in order before the index is used: about 10 ms."""
NEAR = 5_000
"""Motions read of the creation times of a page: a bulk load gives thousands the same; workers write 32 at a time."""
UNREVIEWED = "new"
PREFIX = 32
"""Maximum characters of a name's beginning that `ix_motion_search_filters` holds (migration 0017)."""
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
    others = sa.true() if job is not None else _any_of_others(tenant)
    ours = table.tenant_id == tenant if job is None else table.job_id == job
    scope = _lexeme("t", tenant) if job is None else _lexeme("j", str(job))
    place = None if cursor is None else order.place(cursor, ours)
    return _Page(conn, found, order, ours, scope, others, place, limit).find()


@dataclass(frozen=True)
class _Page:
    """The search for one page of motions."""

    conn: sa.Connection
    found: MotionFilter
    order: Order
    ours: sa.ColumnElement[bool]
    """The motions of the listing, by a column."""
    scope: sa.ColumnElement[str]
    """The same as a term."""
    others: sa.ColumnElement[bool]
    """True if there may be motions outside the listing."""
    place: Place | None
    limit: int

    def find(self) -> list[UUID]:
        if not _conditions(self.found, tables.motion_search.c.terms):
            return self._read(self._walk().with_only_columns(tables.motion_search.c.motion_id).limit(self.limit), _WALK)
        ids = self._among_newest()
        return ids if len(ids) == self.limit else self._by_terms()

    def _among_newest(self) -> list[UUID]:
        recent = self._walk().limit(WALKED).subquery("recent")
        query = sa.select(recent.c.motion_id).where(*_conditions(self.found, recent.c.terms)).limit(self.limit)
        return self._read(query, _WALK)

    def _by_terms(self) -> list[UUID]:
        scope = _has(tables.motion_search.c.terms, self.scope)
        has_others = any(self._read(sa.select(self.others), _WALK))
        # Without the scope they may be times of a tenant that has just begun: `_made_at` reads only our motions.
        times = self._read(self._matching("created_at", *([scope] if has_others else [])), _LOOK_UP)
        ids = self._made_at(times) if times else []
        if len(ids) == len(times):
            return ids
        # Many other motions were made in the same microseconds (a bulk load): sort the matches themselves.
        return self._read(self._matching("motion_id", scope), _LOOK_UP)

    def _matching(self, column: str, *scope: sa.ColumnElement[bool]) -> sa.Select[Any]:
        """Return a column of the matching motions of a page, in order: of their time alone, or with ties by id."""
        table = tables.motion_search.c
        matches = (
            sa.select(table.motion_id, table.created_at)
            .where(*scope, *_conditions(self.found, table.terms, indexed=True))
            .offset(0)  # optimization fence: order and page condition stay outside
            .subquery("matches")
        )
        order = Order(matches.c.created_at, matches.c.motion_id, descending=self.order.descending)
        after = [] if self.place is None else [order.beyond(self.place)]
        by = order.by()[:1] if column == "created_at" else order.by()
        return sa.select(matches.c[column]).where(*after).order_by(*by).limit(self.limit)

    def _made_at(self, times: Sequence[datetime]) -> list[UUID]:
        """Return ids of matching motions by their creation times; ends early after `NEAR` motions of these times."""
        distinct = sa.literal(list(dict.fromkeys(times)), sa.ARRAY(Time))
        moment = sa.func.unnest(distinct).table_valued("at", name="moment").render_derived()
        # A lateral subquery with an order is always run as a nested loop, which keeps the order of the times.
        each = self._walk(tables.motion_search.c.created_at == moment.c.at).lateral("each")
        near = sa.select(each).select_from(moment.join(each, sa.true())).limit(NEAR).subquery("near")
        return self._read(
            sa.select(near.c.motion_id).where(*_conditions(self.found, near.c.terms)).limit(self.limit), _WALK
        )

    def _walk(self, *conditions: sa.ColumnElement[bool]) -> sa.Select[UUID, datetime, Any]:
        """Return the motions of the listing in its order, from the place on."""
        table = tables.motion_search.c
        after = [] if self.place is None else [self.order.beyond(self.place)]
        rows = sa.select(table.motion_id, table.created_at, table.terms)
        return rows.where(self.ours, *conditions, *after).order_by(*self.order.by())

    def _read(self, query: sa.Select[Value], plan: Sequence[str]) -> list[Value]:
        with _plan(self.conn, plan):
            return list(self.conn.execute(query).scalars())


def _any_of_others(tenant: str) -> sa.ColumnElement[bool]:
    """True if another tenant has motions; two look-ups in an index."""
    table = tables.motion_search.c
    return sa.or_(*(sa.exists().where(beside) for beside in (table.tenant_id < tenant, table.tenant_id > tenant)))


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


def _conditions(
    found: MotionFilter, terms: sa.ColumnElement[Any], *, indexed: bool = False
) -> list[sa.ColumnElement[bool]]:
    """Return the conditions of a filter separately, so that the index can intersect them; `indexed`: the name's by
    its first characters, as the index has them."""
    for where, text in (("name", found.name), ("text", found.text), *(("tag", tag) for tag in found.tags)):
        check_text(text, where)
    wanted = [_has(terms, _lexeme("g", tag)) for tag in found.tags]
    if found.name is not None:
        wanted += _begins(found.name, terms, indexed=indexed)
    if found.text is not None:
        asked = sa.func.websearch_to_tsquery(sa.literal_column("'english'::regconfig"), found.text)
        wanted.append(terms.bool_op("@@")(asked))
    verdicts = [*map(str, found.reviews), *([UNREVIEWED] if found.unreviewed else [])]
    if verdicts:
        wanted.append(_has(terms, sa.literal(" | ".join(f"'\x01r{_escaped(each)}'" for each in verdicts))))
    return wanted


def _begins(name: str, terms: sa.ColumnElement[Any], *, indexed: bool) -> list[sa.ColumnElement[bool]]:
    """Return the conditions of a name's beginning. As a prefix of terms it reads an entry for each name that fits:
    of 300,000 names half of the whole search."""
    wanted: list[sa.ColumnElement[bool]] = []
    if indexed and name:
        first = sa.func.left(sa.func.lower(name), PREFIX)
        wanted.append(sa.func.motion_name_prefixes(terms).bool_op("@>")(sa.cast(array([first]), sa.ARRAY(sa.Text))))
    if not wanted or len(name.lower()) > PREFIX:
        wanted.append(_has(terms, sa.literal("'\x01n").concat(sa.func.lower(_escaped(name))).concat("':*")))
    return wanted


def _lexeme(kind: str, value: str) -> sa.ColumnElement[str]:
    """Return a term of `tables.motion_search` as a query."""
    return sa.literal(f"'\x01{kind}{_escaped(value)}'")


def _escaped(text: str) -> str:
    """Escape text for the quotes of a tsquery."""
    return text.replace("\\", "\\\\").replace("'", "''")


def _has(terms: sa.ColumnElement[Any], query: sa.ColumnElement[str]) -> sa.ColumnElement[bool]:
    return terms.bool_op("@@")(sa.cast(query, TSQUERY))
