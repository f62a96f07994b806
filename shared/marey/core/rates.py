"""Rate limits in text form ("600/minute"), by class of request.

No dependency on the library that counts, so that keys and settings can be checked without it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from marey.core.errors import InvalidInput

CLASSES = ("read", "submit", "operate", "parse")
"""Classes of requests: read, create, operate; `parse` is separate because it costs CPU time."""
UNITS = {"second": 1, "minute": 60, "hour": 3600, "day": 86_400}
FORM = re.compile(r"([1-9][0-9]{0,8})/(second|minute|hour|day)")


@dataclass(frozen=True)
class RateLimit:
    """A number of requests in a number of seconds."""

    amount: int
    seconds: int

    def __str__(self) -> str:
        unit = next(name for name, seconds in UNITS.items() if seconds == self.seconds)
        return f"{self.amount}/{unit}"


def read_rate(text: str, *, where: str) -> RateLimit:
    """Parse a rate limit.

    Raises:
        InvalidInput: it is not a rate limit.
    """
    form = FORM.fullmatch(text)
    if form is None:
        hint = "Write 600/minute; or second, hour, day."
        raise InvalidInput(f"{text[:40]!r} is not a rate limit", where=where, hint=hint)
    return RateLimit(int(form[1]), UNITS[form[2]])


def check_rates(rates: Mapping[str, str], *, where: str) -> dict[str, str]:
    """Check rate limits by class of request.

    Raises:
        InvalidInput: an unknown class, or an invalid rate limit.
    """
    for name, text in rates.items():
        if name not in CLASSES:
            raise InvalidInput(f"unknown class {name[:40]!r}; known: {', '.join(CLASSES)}", where=where)
        read_rate(text, where=f"{where}.{name}")
    return dict(rates)
