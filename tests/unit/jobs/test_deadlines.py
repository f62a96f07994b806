"""The table of deadlines: every kind is used, and its limits fit together."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import pytest

from marey.core.settings import Settings
from marey.db import deadlines
from marey.db.deadlines import HEARTBEAT, KINDS, MIGRATION, ORDINARY, PING_SECONDS, PROBE_EVERY, Deadline, in_all

ROOT = Path(__file__).resolve().parents[3]
BAR = 15.0
GUIDE = ROOT / "docs" / "explanation" / "reliability.md"
UNITS = {"s": 1.0, "h": 3600.0}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_kind_of_call_is_used(kind: Deadline) -> None:
    (constant,) = [name for name, value in vars(deadlines).items() if value is kind]
    uses = re.compile(rf"(transaction\([^\n]*, (db\.)?|deadline(=|\()(db\.)?|: Deadline = ){constant}\b")
    files = [path for folder in ("shared", "services") for path in (ROOT / folder).rglob("*.py")]
    assert any(uses.search(path.read_text(encoding="utf-8")) for path in files)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_the_server_ends_a_slow_statement_before_the_client_gives_up(kind: Deadline) -> None:
    assert 1 <= kind.answer - kind.statement <= 5


def test_the_kinds_stand_in_the_order_of_their_limits() -> None:
    assert all(one.statement <= next_one.statement for one, next_one in pairwise(KINDS))


def test_a_silent_connection_is_found_and_its_locks_are_gone_well_within_the_bar() -> None:
    assert PROBE_EVERY + PING_SECONDS < BAR / 2
    assert ORDINARY.answer < BAR
    assert ORDINARY.idle < BAR - PING_SECONDS


def test_several_heartbeats_fit_into_a_lease() -> None:
    config = Settings()
    assert HEARTBEAT.answer + HEARTBEAT.idle < config.lease_seconds
    assert config.heartbeat_seconds + HEARTBEAT.answer < config.lease_seconds


def test_an_index_over_all_items_may_take_an_hour() -> None:
    assert MIGRATION.statement == 3600


def test_short_round_trips_have_no_more_time_in_all_and_long_ones_three_times_theirs() -> None:
    assert [in_all(limit) for limit in (3.0, 4.0, 4.5, 10.0)] == [3.0, 4.0, 13.5, 30.0]


def test_the_guide_states_the_limits_of_every_kind() -> None:
    table = GUIDE.read_text(encoding="utf-8").partition("| heartbeat of a worker |")
    rows = (table[1] + table[2]).partition("\n\n")[0].splitlines()
    told = [[float(n) * UNITS[unit] for n, unit in re.findall(r"\| (\d+) (s|h) (?=\|)", row)] for row in rows]
    answers = [3600.0 if kind is MIGRATION else kind.answer for kind in KINDS]  # 1 h: two seconds are left out
    assert told == [[kind.statement, answer, kind.idle] for kind, answer in zip(KINDS, answers, strict=True)]
