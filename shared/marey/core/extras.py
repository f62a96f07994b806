"""Errors for what needs an extra that is not installed."""

from __future__ import annotations

from marey.core.errors import InvalidInput


def needs_extra(extra: str, error: ImportError) -> InvalidInput:
    """Return the error for what the installed extras cannot run."""
    return InvalidInput(
        f"this needs what the extra {extra!r} installs ({error.name or error} is missing)",
        hint=f"pip install 'marey[{extra}]', or use a server: `marey submit`.",
    )
