"""A model in this process, without a server or a queue."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

from marey.core.cores import cores
from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.items.timeline import prompts_with_rows
from marey.registry import get_model, resolve
from marey.vocabulary.scope import ActionLists, Scope, match_scope, scope_of_rows

if TYPE_CHECKING:
    from marey.bundles import Bundle
    from marey.core.settings import Settings
    from marey.generation.candidates import DrawPlan
    from marey.generation.port import Generator, Request
    from marey.generation.shots.editor import EditModel
    from marey.motion.body import NamedBody
    from marey.motion.clip import MotionClip
    from marey.text.features import TextFeatures


@dataclass(frozen=True)
class Wanted:
    """One motion to generate without a server."""

    prompt: str
    seed: int
    seconds: float | None
    settings: Mapping[str, float]
    timeline: Sequence[Mapping[str, Any]] | None = None
    """Prompts at stated times, of which `prompt` is the text form; None = the prompt alone."""
    constraints: Sequence[Mapping[str, Any]] = ()
    """As `marey.items.constraints.read_constraints` returns them."""


class OneShot:
    """A model in this process, as `marey generate` and `marey.generate` run it."""

    def __init__(self, bundle: Bundle, config: Settings, *, body: NamedBody | None = None) -> None:
        """Load the bundle and its text pipeline; motions have the given body, by default the standard one.

        Raises:
            InvalidInput: the extra `worker` is not installed, or the device is unknown.
            NotFound, InvalidBundle: weights are missing or damaged.
        """
        with extra("worker"):
            from marey.bundles.scope import judges_meaning
            from marey.text.keys import as_served
            from marey.text.meaning import MeaningJudge
            from marey.text.pipeline import TextPipeline

            load = resolve(get_model(bundle.manifest.model, where=str(bundle.path)).load)
        if bundle.manifest.text is None:
            raise InvalidInput(f"{bundle.manifest.name!r} does not read prompts", where=str(bundle.path))
        self.bundle = bundle
        self._body = body
        self._text = TextPipeline.load(as_served(bundle.manifest.text, config=config))
        self._judge = MeaningJudge.of(self._text, config=config) if judges_meaning(bundle.manifest.text) else None
        threads = config.threads or cores()
        self._generator: Generator[Any] = load(bundle, device=config.device, threads=threads)

    def match_scope(self, prompt: str, lists: ActionLists) -> Scope:
        """Return the scope of a prompt: by its words, and by its meaning where they leave it undecided."""
        return match_scope(prompt, lists) if self._judge is None else self._judge.judge(prompt, lists)

    def _scope(self, wanted: Wanted) -> dict[str, Any] | None:
        lists = self.bundle.manifest.actions
        if lists is None:
            return None
        scopes = [self.match_scope(prompt, lists) for _, prompt in prompts_with_rows(wanted.prompt, wanted.timeline)]
        return (scopes[0] if wanted.timeline is None else scope_of_rows(scopes)).as_json()

    def _requests(self, wanted: Sequence[Wanted]) -> list[Request]:
        from marey.generation.requests import request_of

        prompts = [[prompt for _, prompt in prompts_with_rows(each.prompt, each.timeline)] for each in wanted]
        features = iter(self._text.features([prompt for each in prompts for prompt in each]))
        return [
            request_of(self._generator, each, [next(features) for _ in of_item], self._scope(each))
            for each, of_item in zip(wanted, prompts, strict=True)
        ]

    def editor(self, settings: Mapping[str, Any]) -> EditModel:
        """Return the model for operations that generate frames.

        Raises:
            InvalidInput: the model cannot generate frames around others, or an unknown setting.
        """
        from marey.generation.shots.editor import EditModel

        def read(prompt: str) -> TextFeatures:
            (features,) = self._text.features([prompt])
            return features

        return EditModel.of(self._generator, settings, read)

    def make(self, wanted: Sequence[Wanted]) -> Iterator[tuple[Wanted, MotionClip, float]]:
        """Yield each motion with its seconds of computation, in the order given.

        Raises:
            InvalidInput: a length out of the bundle's range; raised before anything is generated.
        """
        from marey.generation.candidates import split_settings

        requests = self._requests(wanted)
        start = 0
        for (_, constrained), group in groupby(wanted, key=lambda w: (sorted(w.settings.items()), bool(w.constraints))):
            rows = list(group)
            values, plan = split_settings(rows[0].settings)
            settings, size = self._generator.settings(values), self._generator.batch
            for low in range(0, len(rows), size):
                batch, part = requests[start + low : start + min(low + size, len(rows))], rows[low : low + size]
                began = time.monotonic()
                clips = self._draw(batch, part if constrained else [], settings, plan)
                elapsed = (time.monotonic() - began) / len(batch)
                for row, clip in zip(part, clips, strict=False):
                    yield row, clip, elapsed
            start += len(rows)

    def _draw(
        self, requests: Sequence[Request], constrained: Sequence[Wanted], settings: object, plan: DrawPlan
    ) -> Iterable[MotionClip]:
        """Draw the motions of requests, each with the constraints of its row if there are rows."""
        from marey.generation.candidates import draw_clips

        if not constrained:
            return draw_clips(self._generator, requests, settings, plan, body=self._body)
        from marey.generation.constraints.draw import constrained_clips

        asked = [row.constraints for row in constrained]
        made = constrained_clips(self._generator, requests, asked, settings, plan, body=self._body)
        return [clip for clip in made if clip is not None]  # nothing was dropped
