"""The parts that read prompts, loaded once in a process of tests: a second each time.

`tests/models` and others let pipelines that are loaded from a manifest have them, too: `pipelines_share_parts`.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from marey.bundles import TextSpec
from marey.evaluator import sentences
from marey.text import pipeline
from marey.text.encoders import TextEncoder
from marey.text.labellers import OneAtATime
from marey.text.loading import load_encoder, load_labeller, load_rewriter
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.order_reader import FILE as ORDER_FILE
from marey.text.order_reader import order_reader
from marey.text.pipeline import TextPipeline
from marey.text.reading_encoder import reading_encoder
from marey.text.roles import RoleLabeller


@functools.cache
def shared_labeller() -> RoleLabeller:
    """The shipped labeller, for one thread at a time."""
    return OneAtATime(load_labeller("light"))


@functools.cache
def shared_encoder() -> TextEncoder:
    """The shipped encoder."""
    return load_encoder("minilm")


@functools.cache
def shared_reading_encoder() -> MiniLMEncoder:
    """The shipped encoder as the readers read texts."""
    encoder = shared_encoder()
    assert isinstance(encoder, MiniLMEncoder)
    return reading_encoder(encoder)


@functools.cache
def shared_order_encoder() -> MiniLMEncoder:
    """The shipped encoder as the reader of the order of time reads texts."""
    encoder = shared_encoder()
    assert isinstance(encoder, MiniLMEncoder)
    return reading_encoder(encoder, ORDER_FILE)


def order_of_time(clauses: Sequence[str], moving: Sequence[bool]) -> tuple[int, ...]:
    """Return the numbers of the clauses that ask for a movement, in the order of time, by the shipped reader."""
    return order_reader().order(clauses, moving, shared_order_encoder().encode)


@contextmanager
def pipelines_share_parts() -> Iterator[None]:
    """Let pipelines that are loaded meanwhile have the shipped labeller and the shipped encoder from here."""

    def labeller(name: str) -> RoleLabeller:
        return shared_labeller() if name == "light" else load_labeller(name)

    def encoder(name: str, path: Path | None = None) -> TextEncoder:
        return shared_encoder() if name == "minilm" and path is None else load_encoder(name, path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "load_labeller", labeller)
        for module in (pipeline, sentences):
            patch.setattr(module, "load_encoder", encoder)
        yield


def shared_pipeline(rewriter: str = "none") -> TextPipeline:
    """A pipeline of its own around the shared parts."""
    spec = TextSpec(rewriter=rewriter)
    return TextPipeline(
        spec,
        rewriter=load_rewriter(rewriter, shared_labeller()),
        labeller=shared_labeller(),
        encoder=shared_encoder(),
    )
