"""Errors of jobs."""

from marey.core.errors import InvalidInput


class IdempotencyMismatch(InvalidInput):
    """The idempotency key was used with another body."""

    problem_type = "idempotency-mismatch"
