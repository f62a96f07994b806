"""The work of the queue `mogo`: whole motions. Live sessions are not claimed, see `streaming.py`."""

from __future__ import annotations

from marey.core.settings import settings as configuration
from marey.generation.handler import GeneratorHandler
from marey.models.mogo.bundle import MODEL
from marey.models.mogo.generate import MAX_SESSIONS, Generator, Settings


def create_handler() -> GeneratorHandler[Settings]:
    """What a worker's child makes."""
    return GeneratorHandler(MODEL, Generator.load, MAX_SESSIONS, configuration())
