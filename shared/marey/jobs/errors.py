"""Errors of this room."""

from shared.errors import InvalidInput


class IdempotencyMismatch(InvalidInput):
    """The idempotency key was used with another body."""

    problem_type = "idempotency-mismatch"
