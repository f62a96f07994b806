"""Handler of the queue `momaskpp`."""

from __future__ import annotations

from marey.core.settings import settings as configuration
from marey.generation.groups import MAX_ROWS
from marey.generation.handler import GeneratorHandler
from marey.models.momaskpp.bundle import MODEL
from marey.models.momaskpp.generate import Generator, SamplingSettings


def create_handler() -> GeneratorHandler[SamplingSettings]:
    """Create the handler in a worker's child process."""
    return GeneratorHandler(MODEL, Generator.load, MAX_ROWS, configuration())
