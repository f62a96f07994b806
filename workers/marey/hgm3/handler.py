"""The work of the queue `hgm3`."""

from __future__ import annotations

from shared.settings import settings as configuration
from workers.generating.handler import GeneratorHandler
from workers.hgm3.bundle import MODEL
from workers.hgm3.generate import MAX_ROWS, Generator, Settings


def create_handler() -> GeneratorHandler[Settings]:
    """What a worker's child makes."""
    return GeneratorHandler(MODEL, Generator.load, MAX_ROWS, configuration())
