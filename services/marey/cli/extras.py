"""What of the product this installation has."""

from __future__ import annotations

from marey.core.errors import InvalidInput


def needs_extra(extra: str, error: ImportError) -> InvalidInput:
    """The error for a command that the small client cannot run."""
    return InvalidInput(
        f"this needs what the extra {extra!r} installs ({error.name or error} is missing)",
        hint=f"pip install 'marey[{extra}]', or use a server: `marey submit`.",
    )
