"""The work of the queue `mogo`: whole motions. Live sessions are not claimed, see `workers/mogo/streaming.py`."""

from __future__ import annotations

from shared.settings import settings as configuration
from workers.generating.handler import GeneratorHandler
from workers.mogo.bundle import MODEL
from workers.mogo.generate import MAX_SESSIONS, Generator, Settings


def create_handler() -> GeneratorHandler[Settings]:
    """What a worker's child makes."""
    return GeneratorHandler(MODEL, Generator.load, MAX_SESSIONS, configuration())
