"""The work of the queue `mogo`: whole motions. Live sessions are not claimed, see `workers/marey/mogo/streaming.py`."""

from __future__ import annotations

from marey.generating.handler import GeneratorHandler
from marey.mogo.bundle import MODEL
from marey.mogo.generate import MAX_SESSIONS, Generator, Settings
from marey.settings import settings as configuration


def create_handler() -> GeneratorHandler[Settings]:
    """What a worker's child makes."""
    return GeneratorHandler(MODEL, Generator.load, MAX_SESSIONS, configuration())
