"""Handler of the queue `mogo`: whole motions. Live sessions are not claimed, see `streaming.py`."""

from __future__ import annotations

from marey.core.settings import settings as configuration
from marey.generation.handler import GeneratorHandler
from marey.models.mogo.bundle import MODEL
from marey.models.mogo.generate import MAX_SESSIONS, Generator, SamplingSettings


def create_handler() -> GeneratorHandler[SamplingSettings]:
    """Create the handler in a worker's child process."""
    return GeneratorHandler(MODEL, Generator.load, MAX_SESSIONS, configuration())
