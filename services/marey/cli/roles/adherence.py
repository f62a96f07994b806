"""Prompt adherence of a bundle, measured in this process, for `marey eval adherence`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.registry import ModelSpec, get_model, resolve


@dataclass(frozen=True)
class Judged:
    """The report of a bundle.

    Attributes:
        markdown: its tables.
        document: all of it, as JSON values.
        failures: prompts whose motions do something else, by group.
    """

    markdown: str
    document: Mapping[str, Any]
    failures: Mapping[str, list[str]]


def judge_adherence(
    bundle: str,
    *,
    seeds: int,
    seconds: float | None,
    settings: Mapping[str, float],
    captions: Path | None,
    prompts: str,
    every: int,
    steers: int,
    walks: int,
    threads: int,
    output: Path | None,
    progress: Callable[[int, int], None],
) -> Judged:
    """Judge the motions that a bundle makes of a set of prompts; write the report where a folder is given.

    Args:
        captions: a prepared folder, whose validation captions are asked for in place of the set `prompts`.
        every: use only every n-th prompt.
        steers: live sessions that are steered.
        walks: live sessions of 2,000 frames.

    Raises:
        NotFound, InvalidBundle: of the bundle.
        InvalidInput: no such set or setting, or live sessions of a model that does not stream.
    """
    with extra("worker"):
        from marey.bundles import choose_bundle
        from marey.bundles.limits import check_settings
        from marey.checks.prompts import PromptSet, evaluation_prompts
        from marey.training import adherence
    sets = get_args(PromptSet)
    if prompts not in sets:
        raise InvalidInput(f"there is no set {prompts!r}", where="--prompts", hint=f"Known: {', '.join(sets)}.")
    found = choose_bundle(bundle)
    spec = get_model(found.manifest.model, where=bundle)
    judge_live = _live_judge(spec) if steers or walks else None
    values = check_settings(found, settings)
    asked = adherence.validation_prompts(captions) if captions else evaluation_prompts(prompts)
    generator = resolve(spec.load)(found, threads=threads)
    report = adherence.judge_bundle(
        generator, asked[::every], seeds=seeds, seconds=seconds, settings=values, progress=progress
    )
    document, markdown = dict(report.to_json()), report.markdown()
    if judge_live is not None:
        live = judge_live(generator, evaluation_prompts(prompts), steers=steers, walks=walks)
        markdown += _live_table(live)
        document["live"] = {title: [asdict(each) for each in sessions] for title, sessions in live.items()}
    if output is not None:
        adherence.write_report(document, markdown, output)
    return Judged(markdown, document, adherence.failures_of(report))


def _live_judge(spec: ModelSpec) -> Callable[..., Mapping[str, Sequence[Any]]]:
    if spec.live_adherence is None:
        raise InvalidInput(f"the model {spec.name!r} has no live sessions", where="--steers, --walks")
    return resolve(spec.live_adherence)


def _live_table(live: Mapping[str, Sequence[Any]]) -> str:
    """Return a table of sessions, and of the share of them that did what they were told."""
    lines = ["", "| live sessions | sessions | obeyed |", "|---|---|---|"]
    for title, sessions in live.items():
        if sessions:
            share = sum(each.passed for each in sessions) / len(sessions)
            lines.append(f"| {title} | {len(sessions)} | {share:.1%} |")
    return "\n".join(lines) + "\n"
