"""Due times of a cron line in a time zone, computed by cronsim: Debian's cron, also at clock changes.

A time that a clock change skips becomes the end of the gap; one that occurs twice is due once, at the first, unless
its line names every hour or every minute.
"""

from __future__ import annotations

import difflib
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from zoneinfo import ZoneInfo, available_timezones

from cronsim import CronSim, CronSimError

from marey.core.errors import InvalidInput

FIELDS = 5
MAX_LENGTH = 200
HINT = 'Five fields: minute, hour, day of the month, month, day of the week. "0 3 * * 1" is every Monday at 03:00.'
MOST_TRIES = 10_000
"""Candidates examined until one lies after the given moment; at most those of an hour that occurs twice."""


def check_cron(cron: str) -> str:
    """Validate a cron line and return it with single spaces.

    Raises:
        InvalidInput: not a cron line, or it names a day that no year has.
    """
    text = " ".join(cron.split())
    next_time(text, "UTC", datetime(2026, 1, 1, tzinfo=UTC))
    return text


def check_zone(name: str) -> str:
    """Validate the name of a time zone and return its canonical form.

    Raises:
        InvalidInput: the name is unknown.
    """
    if name in _zones():
        return name
    near = difflib.get_close_matches(name, _zones(), n=3) if len(name) < MAX_LENGTH else []
    hint = f"Did you mean {', '.join(near)}?" if near else "Names are those of the tz database, as Europe/Berlin."
    raise InvalidInput(f"there is no time zone {name[:60]!r}", where="time_zone", hint=hint)


def next_time(cron: str, zone: str, after: datetime) -> datetime:
    """Return the first due time after a moment, in UTC.

    Raises:
        InvalidInput: the line is invalid, or never due again.
    """
    times = _times(cron, after.astimezone(ZoneInfo(zone)))
    try:
        for _ in range(MOST_TRIES):
            found = next(times).astimezone(UTC)
            if found > after:  # in an hour that occurs twice, cronsim uses the first
                return found
    except (StopIteration, OverflowError):
        pass
    raise InvalidInput(f"{cron!r} is never due", where="cron", hint=HINT)


def last_time(cron: str, zone: str, until: datetime, since: datetime) -> datetime:
    """Return the last due time at or before `until`, not before `since`, which is one itself; it stands for all
    between.

    Raises:
        InvalidInput: the line is invalid.
    """
    times = _times(cron, (until + timedelta(seconds=1)).astimezone(ZoneInfo(zone)), reverse=True)
    for found in times:
        if found.astimezone(UTC) <= until:
            return max(found.astimezone(UTC), since)
    return since


def _times(cron: str, start: datetime, *, reverse: bool = False) -> CronSim:
    if len(cron) > MAX_LENGTH or len(cron.split()) != FIELDS:
        raise InvalidInput(f"{cron[:60]!r} does not have five fields", where="cron", hint=HINT)
    try:
        return CronSim(cron, start.replace(microsecond=0), reverse)
    except CronSimError as error:
        raise InvalidInput(f"{cron!r}: {str(error).lower()}", where="cron", hint=HINT) from error


@lru_cache(maxsize=1)
def _zones() -> frozenset[str]:
    return frozenset(available_timezones())
