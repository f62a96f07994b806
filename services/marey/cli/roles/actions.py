"""Adherence per action, measured in this process, for `marey eval actions`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.core.errors import InvalidInput
from marey.core.extras import needs_extra
from marey.registry import get_model, resolve

if TYPE_CHECKING:
    from marey.referee.adherence import ActionTrial
    from marey.referee.prompts import ActionPrompt


@dataclass(frozen=True)
class ActionsMeasured:
    """The report of a bundle: its table, and all of it as JSON values."""

    markdown: str
    document: Mapping[str, Any]


def measure_actions(
    bundle: str,
    *,
    actions: Sequence[str],
    seeds: int,
    settings: Mapping[str, float],
    threads: int,
    output: Path | None,
    progress: Callable[[int, int], None],
) -> ActionsMeasured:
    """Generate the held-out prompts of actions with a bundle, and let the referee judge the exported joints.

    Args:
        actions: ids of the vocabulary; none = all.
        seeds: motions of each prompt, with the seeds from 0 on.
        settings: sampling settings by name.
        output: folder for report.json and report.md.

    Raises:
        NotFound, InvalidBundle: of the bundle.
        InvalidInput: no such action or setting.
    """
    try:
        from marey.bundles import choose_bundle
        from marey.bundles.limits import check_settings
        from marey.referee import adherence
    except ImportError as error:
        raise needs_extra("worker", error) from error
    found = choose_bundle(bundle)
    values = check_settings(found, settings)
    asked = _asked(actions)
    generator = resolve(get_model(found.manifest.model, where=bundle).load)(found, threads=threads)
    trials = _trials(generator, asked, seeds, generator.settings(values), progress)
    reference = generator.bundle.reference
    made = adherence.document(reference, generator.describe_settings(generator.settings(values)), trials)
    table = adherence.markdown(reference, adherence.rates(trials))
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        (output / "report.json").write_text(json.dumps(made, indent=1), encoding="utf-8")
        (output / "report.md").write_text(table, encoding="utf-8")
    return ActionsMeasured(table, made)


def _asked(actions: Sequence[str]) -> list[ActionPrompt]:
    from marey.referee.prompts import action_prompts

    prompts = action_prompts()
    known = {action for prompt in prompts for action in prompt.actions}
    if unknown := [action for action in actions if action not in known]:
        raise InvalidInput(
            f"there are no held-out prompts for {unknown[0]!r}",
            where="--action",
            hint=f"Known: {', '.join(sorted(known))}.",
        )
    return [prompt for prompt in prompts if not actions or set(prompt.actions) <= set(actions)]


def _trials(
    generator: Any, prompts: Sequence[ActionPrompt], seeds: int, settings: Any, progress: Callable[[int, int], None]
) -> list[ActionTrial]:
    from marey.generation.export import finish
    from marey.generation.port import Request
    from marey.referee import Body
    from marey.referee.adherence import judge_trial
    from marey.training.adherence import pipeline_of

    texts = pipeline_of(generator).features([prompt.text for prompt in prompts])
    jobs = [(prompt, Request(text, seed)) for seed in range(seeds) for prompt, text in zip(prompts, texts, strict=True)]
    trials: list[ActionTrial] = []
    for start in range(0, len(jobs), generator.batch):
        part = jobs[start : start + generator.batch]
        made = generator.generate([request for _, request in part], settings)
        for (prompt, request), motion in zip(part, made, strict=True):
            clip = finish(generator, request, motion, settings)
            trials.append(judge_trial(prompt, request.seed, Body(clip.joints, clip.fps)))
        progress(len(trials), len(jobs))
    return trials
