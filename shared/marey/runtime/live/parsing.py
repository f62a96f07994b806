"""Parsing of prompts in the background: a rewriter may be slow, and the supervisor has other streams to manage."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

from marey.core.errors import MareyError
from marey.runtime.faults import as_problem
from marey.runtime.live.port import Parse
from marey.runtime.logs import logger
from marey.streams import StreamPast, StreamRow
from marey.streams.redis import FrameStream, Lease
from marey.text.features import TextFeatures

log = logger(__name__)


class PromptParsing:
    """Features of some prompts, computed on a daemon thread.

    Args:
        parse: parses one prompt; may be called on several threads at once.
        prompts: in the order of the result.
    """

    def __init__(self, parse: Parse, prompts: Sequence[str]) -> None:
        self._parse, self._prompts = parse, prompts
        self._found: list[TextFeatures] = []
        self._problem: MareyError | None = None
        self._done = threading.Event()
        threading.Thread(target=self._read, name="reader", daemon=True).start()

    def is_done(self, seconds: float = 0.0) -> bool:
        """Return True if the result is there, now or within `seconds`."""
        return self._done.wait(seconds)

    def features(self) -> list[TextFeatures]:
        """Return the features of each prompt, after `is_done`.

        Raises:
            MareyError: a prompt cannot be parsed.
        """
        assert self._done.is_set()
        if self._problem is not None:
            raise self._problem
        return self._found

    def _read(self) -> None:
        try:
            self._found = [self._parse(prompt) for prompt in self._prompts]
        except Exception as error:
            self._problem = as_problem(error)
            if self._problem is not error:
                log.exception("prompt_not_read")
        finally:
            self._done.set()


@dataclass(eq=False)
class StartingStream:
    """A taken stream whose prompts are being parsed; its lease is renewed like any other.

    Attributes:
        parsing: parsing of the first prompt, and of the one in force if that is another.
        lost: True if another worker has it.
    """

    past: StreamPast
    frames: FrameStream
    lease: Lease
    parsing: PromptParsing
    lost: bool = False

    @property
    def row(self) -> StreamRow:
        """The row at the time of taking."""
        return self.past.row

    @property
    def prompts(self) -> list[tuple[int, str]]:
        """Every prompt so far, with the frame from which it is in force."""
        return list(self.past.prompts) or [(0, self.row.prompt)]
