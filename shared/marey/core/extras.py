"""Errors for what needs an extra that is not installed."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

from marey.core.errors import InvalidInput


class MissingExtra(InvalidInput):
    """An extra that is needed and not installed."""

    def __init__(self, extra: str, missing: str) -> None:
        """Set the message.

        Args:
            extra: its name.
            missing: the module that was not found.
        """
        super().__init__(
            f"this needs what the extra {extra!r} installs ({missing} is missing)",
            hint=f"pip install 'marey[{extra}]', or use a server: `marey submit`.",
        )
        self.extra = extra


def needs_extra(extra: str, error: ImportError) -> MissingExtra:
    """Return the error for what the installed extras cannot run."""
    return MissingExtra(extra, error.name or str(error))


@contextmanager
def extra(name: str) -> Generator[None]:
    """Import, in the block, what an extra installs. Ctrl-C acts when the imports have ended.

    Raises:
        MissingExtra: something that is imported in the block is not installed.
        KeyboardInterrupt: Ctrl-C was pressed meanwhile.
    """
    try:
        with _interrupt_later():
            yield
    except ImportError as error:
        raise needs_extra(name, error) from error


@contextmanager
def _interrupt_later() -> Generator[None]:
    """Raise `KeyboardInterrupt` after the block: within an import, libraries take it for a missing module, or abort."""
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    interrupted = threading.Event()

    def note(_number: int, _frame: FrameType | None) -> None:
        interrupted.set()

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if interrupted.is_set():
            raise KeyboardInterrupt
