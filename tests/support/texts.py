"""The parts that read prompts, loaded once in a process of tests: a second each time."""

from __future__ import annotations

import functools
from collections.abc import Sequence

from marey.bundles import TextSpec
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


def shared_pipeline(rewriter: str = "none") -> TextPipeline:
    """A pipeline of its own around the shared parts."""
    spec = TextSpec(rewriter=rewriter)
    return TextPipeline(
        spec,
        rewriter=load_rewriter(rewriter, shared_labeller()),
        labeller=shared_labeller(),
        encoder=shared_encoder(),
    )
