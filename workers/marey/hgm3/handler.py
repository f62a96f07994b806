"""The work of the queue `hgm3`."""

from __future__ import annotations

from marey.generating.handler import GeneratorHandler
from marey.hgm3.bundle import MODEL
from marey.hgm3.generate import MAX_ROWS, Generator, Settings
from marey.settings import settings as configuration


def create_handler() -> GeneratorHandler[Settings]:
    """What a worker's child makes."""
    return GeneratorHandler(MODEL, Generator.load, MAX_ROWS, configuration())
