"""The error hierarchy.

A message states what is wrong, where (file, line, field) and what to do about it. The command line prints an
expected error verbatim and exits with `exit_code`; the API answers an RFC 9457 problem with `status` and
`problem_type`. Any other exception is a bug and shows a traceback (or a 500).
"""

from __future__ import annotations

TYPE_PREFIX = "urn:marey:problem:"
"""Before the `problem_type` of an error in the `type` of a problem."""


class MareyError(Exception):
    """Base class of expected failures, with a message for users.

    Args:
        message: what is wrong, one sentence.
        where: file, line, field, row or identifier the message is about.
        hint: what to do about it.
        argument: name of the argument of the Python API to change, such as `overwrite`; the command line names the
            option in its place.
    """

    exit_code = 1
    status = 500
    problem_type = "internal"

    def __init__(
        self, message: str, *, where: str | None = None, hint: str | None = None, argument: str | None = None
    ) -> None:
        super().__init__(message)
        self.message = message
        self.where = where
        self.hint = hint
        self.argument = argument

    @property
    def on_a_line(self) -> str:
        """Return the message with its hint, for lists that say elsewhere what it is about."""
        return f"{self.message}. {self.hint}" if self.hint else self.message

    def __str__(self) -> str:
        text = f"{self.where}: {self.message}" if self.where else self.message
        return f"{text}\n  {self.hint}" if self.hint else text


class InvalidInput(MareyError):
    """Input that cannot be used: a prompt, a file, an option, a bundle."""

    exit_code = 2
    status = 422
    problem_type = "invalid-input"


class TooLarge(InvalidInput):
    """Input over a documented limit."""

    status = 413
    problem_type = "too-large"


class MalformedRequest(InvalidInput):
    """The bytes that came are no HTTP request."""

    status = 400
    problem_type = "malformed-request"


class UpgradeMissing(InvalidInput):
    """A WebSocket handshake that arrived as an ordinary request: a proxy did not forward `Upgrade`."""

    status = 426
    problem_type = "upgrade-missing"


class InvalidFile(InvalidInput):
    """A file that is broken, foreign or truncated."""

    problem_type = "invalid-file"


class InvalidBundle(InvalidFile):
    """A model bundle that is corrupt, foreign, of another version, or whose licence is not allowed here."""

    problem_type = "invalid-bundle"


class Conflict(InvalidInput):
    """A request that contradicts the current state: an illegal transition, an existing different file."""

    status = 409
    problem_type = "conflict"


class NotFound(MareyError):
    """A job, motion, bundle or file that does not exist, or belongs to another tenant."""

    exit_code = 3
    status = 404
    problem_type = "not-found"


class Unreachable(MareyError):
    """A server, database, queue or store that did not answer; a later retry may work."""

    exit_code = 4
    status = 503
    problem_type = "unreachable"

    def __init__(
        self, message: str, *, where: str | None = None, hint: str | None = None, public: str | None = None
    ) -> None:
        """Set the message for operators, and the one for API clients.

        Args:
            public: message for API clients: which dependency is down, never where or how. None = only that a
                dependency is down.
        """
        super().__init__(message, where=where, hint=hint)
        self.public = public


class Overloaded(Unreachable):
    """No capacity for the request now; the same request works later.

    Args:
        seconds: retry delay.
    """

    problem_type = "overloaded"

    def __init__(self, message: str, *, where: str | None = None, hint: str | None = None, seconds: int) -> None:
        super().__init__(message, where=where, hint=hint, public=message)
        self.seconds = seconds


class TooSlow(MareyError):
    """A request that arrived slower than the server's limit; a retry may work."""

    exit_code = 4
    status = 408
    problem_type = "too-slow"


class Refused(MareyError):
    """A forbidden request: the key lacks the scope, or a quota or rate limit is exhausted."""

    exit_code = 5
    status = 403
    problem_type = "refused"


class Unauthenticated(Refused):
    """A missing or invalid key."""

    status = 401
    problem_type = "unauthenticated"


class Busy(Refused):
    """A quota or rate limit that is exhausted for now.

    Args:
        seconds: retry delay.
    """

    status = 429
    problem_type = "busy"

    def __init__(self, message: str, *, where: str | None = None, hint: str | None = None, seconds: int) -> None:
        super().__init__(message, where=where, hint=hint)
        self.seconds = seconds


class QuotaUsedUp(Busy):
    """A tenant's quota does not allow the request; nothing was written.

    Args:
        quota: name of the quota: `queued`, `bytes`.
        limit, used, asked: items or bytes.
    """

    problem_type = "quota"

    def __init__(
        self,
        message: str,
        *,
        where: str | None = None,
        hint: str | None = None,
        seconds: int,
        quota: str,
        limit: int,
        used: int,
        asked: int,
    ) -> None:
        super().__init__(message, where=where, hint=hint, seconds=seconds)
        self.quota = quota
        self.limit = limit
        self.used = used
        self.asked = asked

    @property
    def left(self) -> int:
        """Remaining items or bytes."""
        return max(self.limit - self.used, 0)


class PluginError(MareyError):
    """An installed plug-in cannot be used, or one that is needed is not installed."""


class ItemsFailed(MareyError):
    """Work that ended with items failed, dead or cancelled."""

    exit_code = 6
    problem_type = "items-failed"


class TimedOut(MareyError):
    """The caller's time limit has passed."""

    exit_code = 7
    status = 504
    problem_type = "timed-out"


class Regressed(MareyError):
    """An evaluation that is done, and worse than its baseline."""

    exit_code = 8
    problem_type = "regressed"
