"""Cron lines in time zones, also where clocks change."""

from __future__ import annotations

import contextlib
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.evaluations.cron import check_cron, check_zone, last_time, next_time

BERLIN = "Europe/Berlin"
SPRING, AUTUMN = (2026, 3, 29), (2026, 10, 25)
"""At 02:00 clocks go to 03:00; at 03:00 they go back to 02:00."""

minutes = st.sampled_from(["0", "*", "30", "*/20", "5,35", "59"])
hours = st.sampled_from(["*", "2", "3", "1-3", "*/6", "0,23"])
days = st.sampled_from(["*", "1", "L", "15,31", "*/10"])
weekdays = st.sampled_from(["*", "1", "MON-FRI", "0", "7", "5L", "SUN#2"])
lines = st.builds(lambda *fields: " ".join(fields), minutes, hours, days, st.sampled_from(["*", "3", "10"]), weekdays)
zones = st.sampled_from(["UTC", BERLIN, "America/New_York", "Australia/Lord_Howe", "Asia/Kolkata", "Pacific/Apia"])
moments = st.datetimes(datetime(2025, 1, 1), datetime(2027, 12, 31)).map(lambda moment: moment.replace(tzinfo=UTC))


def due_on(day: tuple[int, int, int], cron: str, zone: str = BERLIN) -> list[str]:
    """The times of a line from midnight to midnight of a day, as a clock in UTC shows them."""
    start = datetime(*day, tzinfo=ZoneInfo(zone))
    end = (start + timedelta(days=1)).astimezone(UTC)
    found: list[str] = []
    at = start.astimezone(UTC) - timedelta(seconds=1)
    while (at := next_time(cron, zone, at)) < end:
        found.append(f"{at:%H:%M}")
    return found


def test_three_in_the_morning_comes_once_on_both_days_of_change() -> None:
    assert due_on((2026, 3, 28), "0 3 * * *") == ["02:00"]  # winter time
    assert due_on(SPRING, "0 3 * * *") == ["01:00"]  # the very moment of the change
    assert due_on((2026, 10, 24), "0 3 * * *") == ["01:00"]
    assert due_on(AUTUMN, "0 3 * * *") == ["02:00"]


def test_a_time_that_the_change_leaves_out_comes_at_the_end_of_the_gap() -> None:
    assert due_on(SPRING, "30 2 * * *") == ["01:00"]


def test_two_times_that_the_change_leaves_out_are_one() -> None:
    assert due_on(SPRING, "0,30 2 * * *") == ["01:00"]


def test_a_time_that_comes_twice_is_due_at_the_first() -> None:
    assert due_on(AUTUMN, "30 2 * * *") == ["00:30"]


def test_a_line_of_every_hour_runs_through_both_days() -> None:
    assert len(due_on(SPRING, "0 * * * *")) == 23
    assert len(due_on(AUTUMN, "0 * * * *")) == 25


def test_in_the_hour_that_comes_again_the_next_time_is_not_in_the_past() -> None:
    """Between 02:30 summer time and 02:30 winter time lies the time that was due."""
    between = datetime(2026, 10, 25, 1, 10, tzinfo=UTC)
    assert next_time("30 2 * * *", BERLIN, between) == datetime(2026, 10, 26, 1, 30, tzinfo=UTC)


def first_time(cron: str, zone: str, after: datetime) -> datetime:
    """Return the next time of a line that has one: 02:00 of the second Sunday in March is left out every year in some
    zones."""
    try:
        return next_time(cron, zone, after)
    except InvalidInput:
        reject()


@given(lines, zones, moments)
def test_the_next_time_lies_after_now_and_next_times_only_grow(cron: str, zone: str, now: datetime) -> None:
    first = first_time(cron, zone, now)
    second = next_time(cron, zone, first)
    assert now < first < second


@given(lines, zones, moments, st.integers(0, 40 * 24 * 60))
def test_what_stands_for_the_missed_times_is_none_of_the_future_and_none_before_the_first(
    cron: str, zone: str, start: datetime, minutes_away: int
) -> None:
    since = first_time(cron, zone, start)
    now = since + timedelta(minutes=minutes_away)
    due = last_time(cron, zone, now, since)
    assert since <= due <= now
    if due > since:  # and it is a time of the line: the one after a second earlier
        assert next_time(cron, zone, due - timedelta(seconds=1)) == due


def test_after_days_of_outage_the_newest_time_stands_for_all() -> None:
    since, now = datetime(2026, 11, 1, 2, tzinfo=UTC), datetime(2026, 11, 9, 14, 5, tzinfo=UTC)
    assert last_time("0 3 * * *", BERLIN, now, since) == datetime(2026, 11, 9, 2, tzinfo=UTC)
    assert next_time("0 3 * * *", BERLIN, now) == datetime(2026, 11, 10, 2, tzinfo=UTC)


def test_a_time_of_the_hour_that_came_twice_is_still_due_in_its_second_round() -> None:
    since = datetime(2026, 10, 25, 0, 30, tzinfo=UTC)  # 02:30 summer time
    assert last_time("30 2 * * *", BERLIN, since + timedelta(minutes=40), since) == since


def test_a_moment_that_is_a_time_itself_is_due() -> None:
    now = datetime(2026, 11, 9, 2, tzinfo=UTC)
    assert last_time("0 3 * * *", BERLIN, now, now - timedelta(days=3)) == now


@pytest.mark.parametrize(
    ("cron", "said"),
    [
        ("", "five fields"),
        ("0 3 * *", "five fields"),
        ("0 0 3 * * 1", "five fields"),
        ("@daily", "five fields"),
        ("61 3 * * *", "bad minute"),
        ("0 24 * * *", "bad hour"),
        ("0 3 32 * *", "bad day-of-month"),
        ("0 3 30 2 *", "bad day-of-month"),
        ("0 3 * 13 *", "bad month"),
        ("0 3 * * FOO", "bad day-of-week"),
        ("0 3 * * 1 ; rm -rf", "five fields"),
        ("0 3 * * 1" * 100, "five fields"),
        ("0 3 29 2 MON#6", "bad day-of-week"),
    ],
)
def test_a_bad_line_is_refused_and_an_example_given(cron: str, said: str) -> None:
    with pytest.raises(InvalidInput, match=said) as caught:
        check_cron(cron)
    assert "every Monday at 03:00" in str(caught.value.hint)
    assert caught.value.where == "cron"


@given(st.text(max_size=40))
def test_no_text_is_more_than_an_invalid_input(text: str) -> None:
    with contextlib.suppress(InvalidInput):
        check_cron(text)


def test_blanks_between_fields_are_made_single() -> None:
    assert check_cron("  0  3 *\t* 1 ") == "0 3 * * 1"


@pytest.mark.parametrize("name", ["Europe/Berlun", "", "Europe", "../UTC", "/etc/localtime", "x" * 500, "CEST2"])
def test_an_unknown_time_zone_is_refused(name: str) -> None:
    with pytest.raises(InvalidInput, match=r"^time_zone: there is no time zone"):
        check_zone(name)


def test_a_mistyped_time_zone_is_answered_with_those_it_may_be() -> None:
    with pytest.raises(InvalidInput) as caught:
        check_zone("Europe/Berlun")
    assert BERLIN in str(caught.value.hint)
