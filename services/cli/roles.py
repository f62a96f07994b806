"""What the workers of this product are; the only module of `services` that imports `workers`, and only when asked."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

from shared.errors import InvalidInput

if TYPE_CHECKING:
    from pathlib import Path

    from shared.bundles import Bundle
    from shared.motion.clip import MotionClip
    from shared.runtime.handler import Role
    from shared.settings import Settings

HANDLERS = {"hgm3": "workers.hgm3.handler:create_handler", "text": "services.text.handler:create_handler"}
"""Factories by queue, as strings: only a worker's child imports them, and with them torch."""
GENERATORS = frozenset({"hgm3"})
DEFAULT_ROLES = "hgm3+text"
"""One child that generates, and parses prompts when there are any: two would fight for the cores."""


def parse_roles(text: str) -> list[tuple[str, ...]]:
    """`hgm3+text,hgm3` → one worker of both queues and one of the first.

    Raises:
        InvalidInput: an unknown queue.
    """
    roles = [tuple(part.strip() for part in role.split("+")) for role in text.split(",")]
    for name in (name for role in roles for name in role):
        if name not in HANDLERS:
            raise InvalidInput(
                f"there is no worker {name!r}",
                where="--with",
                hint=f"Known: {', '.join(HANDLERS)}; + joins them in one child, a comma separates children.",
            )
    return roles


def role_of(queues: Sequence[str], config: Settings) -> Role:
    """The role of a worker that serves these queues, its model loaded before it is ready.

    Raises:
        NotFound, InvalidBundle: there is no bundle for its model, or a broken one.
    """
    from shared.bundles import choose_bundle
    from shared.runtime.handler import Role

    preload = {q: choose_bundle(q, config=config).reference for q in queues if q in GENERATORS}
    return Role("+".join(queues), {queue: HANDLERS[queue] for queue in queues}, preload)


def threads_of(config: Settings, torch_children: int) -> int:
    """Torch threads of one child: the cores, divided by the children that compute."""
    return config.threads or max(1, len(os.sched_getaffinity(0)) // max(1, torch_children))


@dataclass(frozen=True)
class Wanted:
    """One motion to make without a server."""

    prompt: str
    seed: int
    seconds: float | None
    settings: Mapping[str, float]


class OneShot:
    """A model in this process: what `marey generate` runs."""

    def __init__(self, bundle: Bundle, config: Settings) -> None:
        """Load the bundle and what reads its prompts.

        Raises:
            InvalidInput: the extra `worker` is not installed, or there is no such device.
            NotFound, InvalidBundle: weights are missing or damaged.
        """
        try:
            from shared.text.pipeline import TextPipeline
            from workers.hgm3.generate import Generator
        except ImportError as error:
            raise needs_extra("worker", error) from error
        if bundle.manifest.text is None:
            raise InvalidInput(f"{bundle.manifest.name!r} does not read prompts", where=str(bundle.path))
        self.bundle = bundle
        self._text = TextPipeline.load(bundle.manifest.text)
        self._generator = Generator.load(bundle, device=config.device, threads=threads_of(config, 1))

    def make(self, wanted: Sequence[Wanted]) -> Iterator[tuple[Wanted, MotionClip, float]]:
        """Each motion with the seconds it took, in the order given.

        Raises:
            InvalidInput: a length this bundle cannot make; before anything is made.
        """
        from workers.hgm3.export import finish
        from workers.hgm3.generate import MAX_ROWS, Request, Settings

        features = self._text.features([w.prompt for w in wanted])
        fps = self._generator.config.fps
        requests = [
            Request(text, w.seed, None if w.seconds is None else round(w.seconds * fps))
            for w, text in zip(wanted, features, strict=True)
        ]
        self._generator.frames(requests)
        start = 0
        for _, group in groupby(wanted, key=lambda w: sorted(w.settings.items())):
            rows = list(group)
            settings = Settings(**rows[0].settings)  # pyright: ignore[reportArgumentType] - checked by shared.items
            for low in range(0, len(rows), MAX_ROWS):
                batch = requests[start + low : start + min(low + MAX_ROWS, len(rows))]
                began = time.monotonic()
                made = self._generator.generate(batch, settings)
                elapsed = (time.monotonic() - began) / len(batch)
                for row, request, generated in zip(rows[low:], batch, made, strict=False):
                    assert generated is not None  # nothing was dropped
                    yield row, finish(self._generator, request, generated, settings), elapsed
            start += len(rows)


def make_random_bundle(path: Path) -> None:
    """A tiny HGM³ with random weights: it exercises everything and generates nonsense."""
    from workers.hgm3.bundle import random_bundle

    random_bundle(path)


def needs_extra(extra: str, error: ImportError) -> InvalidInput:
    """The error for a command that the small client cannot run."""
    return InvalidInput(
        f"this needs what the extra {extra!r} installs ({error.name or error} is missing)",
        hint=f"pip install 'marey[{extra}]', or use a server: `marey submit`.",
    )
