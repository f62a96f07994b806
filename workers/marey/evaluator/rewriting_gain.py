"""Measure what the rewriter `tca` gains on prompts in verbs that the vocabulary does not know.

    python -m marey.evaluator.rewriting_gain mogo-open --seeds 4 -o report

Every prompt of `marey.referee.prompts.other_verb_prompts` is read as written and rewritten, with the guard, and
generated with the same seeds; the referee judges the joints by the action that the prompts' key names. Answers are the
recorded ones (`rewriting_answers.toml`), or with `--ask` those of the language model of the settings.
"""

from __future__ import annotations

import argparse
import math
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean, stdev
from typing import Any

from marey.bundles import choose_bundle
from marey.core.settings import settings
from marey.evaluator.recorded_answers import MODEL, RecordedAnswers
from marey.generation.asked import drawing_of
from marey.generation.port import Generator, Request
from marey.referee import Body
from marey.referee.adherence import Z, interval, judge_trial
from marey.referee.prompts import ActionPrompt, other_verb_prompts
from marey.registry import get_model, resolve
from marey.text.features import TextFeatures
from marey.text.openai_rewriter import Endpoint, OpenAIRewriter
from marey.text.pipeline import TextPipeline
from marey.text.wordings import alignment
from marey.training.adherence import finished, pipeline_of, write_report
from marey.vocabulary.entries import load_vocabulary


@dataclass(frozen=True)
class GainRow:
    """One prompt, as written and rewritten.

    Attributes:
        read: as the model reads it with `tca`.
        refused: why the rewrite was not used; None = it was.
        plain, aligned: motions that show the action, as written and with `tca`.
        seeds: motions of each.
    """

    prompt: str
    action: str
    read: str
    refused: str | None
    plain: int
    aligned: int
    seeds: int


def recorded_answers() -> dict[str, str]:
    """Return the recorded answer to each prompt."""
    path = Path(__file__).with_name("rewriting_answers.toml")
    return tomllib.loads(path.read_text("utf-8"))["answers"]


@contextmanager
def answering(*, ask: bool) -> Iterator[Endpoint]:
    """Yield the endpoint of the settings, or one that gives the recorded answers.

    Raises:
        InvalidInput: the settings name no language model.
    """
    if ask:
        yield Endpoint.of(settings())
        return
    with RecordedAnswers(recorded_answers()) as served:
        yield Endpoint(served.url, MODEL)


def aligned_pipeline(plain: TextPipeline, endpoint: Endpoint) -> TextPipeline:
    """Return a bundle's text pipeline with the rewriter `tca` in front."""
    rewriter = OpenAIRewriter(endpoint, alignment(load_vocabulary(), plain.spec.style), "tca")
    spec = plain.spec.model_copy(update={"rewriter": "tca", "rewriter_model": endpoint.model})
    return TextPipeline(spec, rewriter=rewriter, labeller=plain.labeller, encoder=plain.encoder)


def measure_gain(
    generator: Generator[Any],
    prompts: Sequence[ActionPrompt],
    endpoint: Endpoint,
    *,
    seeds: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[GainRow]:
    """Generate each prompt as written and rewritten, and judge the motions; a row for each prompt.

    Raises:
        InvalidBundle: the bundle declares no text pipeline.
    """
    pipeline = pipeline_of(generator)
    said = [prompt.text for prompt in prompts]
    plain, aligned = pipeline.features(said), aligned_pipeline(pipeline, endpoint).features(said)
    jobs = [(way, number, seed) for way in (plain, aligned) for seed in range(seeds) for number in range(len(prompts))]
    passed = [_Passes(prompt) for prompt in prompts]
    done = 0
    for start in range(0, len(jobs), generator.batch):
        part = jobs[start : start + generator.batch]
        for (way, number, seed), body in zip(part, _bodies(generator, part), strict=True):
            passed[number].add(body, seed, aligned=way is aligned)
        done += len(part)
        progress(done, len(jobs))
    return [each.row(read, seeds) for each, read in zip(passed, aligned, strict=True)]


class _Passes:
    """Motions of one prompt that show its action, as written and rewritten."""

    def __init__(self, prompt: ActionPrompt) -> None:
        self.prompt = prompt
        self.counts = [0, 0]

    def add(self, body: Body, seed: int, *, aligned: bool) -> None:
        self.counts[aligned] += judge_trial(self.prompt, seed, body).passed

    def row(self, read: TextFeatures, seeds: int) -> GainRow:
        """Return the row of the prompt, which `tca` brought to what was read."""
        plain, aligned = self.counts
        action = self.prompt.actions[0]
        return GainRow(self.prompt.text, action, read.rewritten, read.not_rewritten, plain, aligned, seeds)


def _bodies(generator: Generator[Any], jobs: Sequence[tuple[Sequence[TextFeatures], int, int]]) -> Iterator[Body]:
    """Generate a batch, and yield the bodies as exported."""
    chosen = generator.settings({})
    drawing = drawing_of(generator, chosen)
    requests = [Request(texts[number], seed, drawing=drawing) for texts, number, seed in jobs]
    for clip in finished(generator, requests, chosen):
        yield Body(clip.joints, clip.fps)


def gain_markdown(bundle: str, rows: Sequence[GainRow]) -> str:
    """Return a report with tables; intervals are over prompts."""
    used = [row for row in rows if row.refused is None]
    refused = [row for row in rows if row.refused is not None]
    lines = [
        f"Bundle `{bundle}`: {len(rows)} prompts in verbs that the vocabulary does not know, {rows[0].seeds} seeds "
        f"each; {len(refused)} rewrites were not used.",
        "",
        "| prompts | as written | with `tca` | gain in points, paired by prompt |",
        "|---|---|---|---|",
        *(_gain_line(name, chosen) for name, chosen in (("all", rows), ("rewritten", used)) if chosen),
        "",
        "| prompt | read as | action | as written | with `tca` |",
        "|---|---|---|---|---|",
        *(f"| {row.prompt} | {row.read} | {row.action} | {row.plain} | {row.aligned} |" for row in rows),
        "",
        *(f"- {row.prompt}: not used, {row.refused}" for row in refused),
    ]
    return "\n".join(lines).rstrip() + "\n"


def _gain_line(name: str, rows: Sequence[GainRow]) -> str:
    cells: list[str] = []
    for shares in ([row.plain / row.seeds for row in rows], [row.aligned / row.seeds for row in rows]):
        low, high = interval(mean(shares), len(shares))
        cells.append(f"{mean(shares):.0%} ({low:.0%} to {high:.0%})")
    gains = [100 * (row.aligned - row.plain) / row.seeds for row in rows]
    half = Z * stdev(gains) / math.sqrt(len(gains)) if len(gains) > 1 else 0.0
    return f"| {name}, {len(rows)} | {cells[0]} | {cells[1]} | {mean(gains):+.0f} ± {half:.0f} |"


def main() -> None:
    """Measure a bundle, and write report.json and report.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundle", help="name or folder of a bundle")
    parser.add_argument("--seeds", type=int, default=4, help="motions of each prompt and reading")
    parser.add_argument("--threads", type=int, default=0, help="of torch; 0 = its own choice")
    parser.add_argument("--ask", action="store_true", help="ask the language model of the MAREY_REWRITER_ settings")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the report")
    given = parser.parse_args()
    bundle = choose_bundle(given.bundle)
    generator = resolve(get_model(bundle.manifest.model).load)(bundle, threads=given.threads)
    with answering(ask=given.ask) as endpoint:
        rows = measure_gain(generator, other_verb_prompts(), endpoint, seeds=given.seeds)
    text = gain_markdown(bundle.reference, rows)
    write_report(
        {"bundle": bundle.reference, "model": endpoint.model, "rows": [asdict(r) for r in rows]}, text, given.output
    )
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
