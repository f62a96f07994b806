"""The request of an evaluation, which runs and schedules share: options, prompts, and the lines of problems."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypedDict

from marey.client.resources import identifier
from marey.client.rows import located, read_evaluation_prompts
from marey.client.tables import ExtraColumns
from marey.client.text_files import where_of
from marey.client.types.evaluations import Evaluation
from marey.core.characters import escape
from marey.items.evaluation_prompts import EvaluationPrompt, PromptCheck, read_prompts
from marey.items.problems import InvalidItems

Split = Literal["test", "compositional", "test+compositional"]
Prompt = EvaluationPrompt | Mapping[str, object] | str
"""A prompt, a dict with prompt or timeline, seconds, expected and constraints, or an `EvaluationPrompt`."""


@dataclass(frozen=True)
class PromptSet:
    """Prompts of an evaluation that were read and checked.

    Attributes:
        source: the name of the prompts in reports.
        where: the source as errors name it.
        lines: the line of each prompt in the source.
    """

    prompts: Sequence[EvaluationPrompt]
    source: str
    where: str
    lines: Sequence[int | None]


class EvaluationOptions(TypedDict, total=False):
    """Options of an evaluation; None = the default of the server.

    Attributes:
        split: captions of the evaluator's bundle; `test` where there are no prompts.
        prompts: in place of a split: prompts, or the path of a CSV or JSONL file with the columns prompt or timeline,
            seconds, expected and, in JSONL, constraints.
        evaluator: bundle that measures; by default the one that the server has.
        settings: of sampling, by name.
        repeats: motions of each prompt; by default 1.
        seed: of the first motion; by default 0.
        baseline: an evaluation of the same prompts to compare with.
    """

    split: Split
    prompts: Iterable[Prompt] | PromptSet | str | Path | None
    evaluator: str | None
    settings: Mapping[str, float] | None
    repeats: int | None
    seed: int | None
    baseline: Evaluation | str | None


@dataclass(frozen=True)
class EvaluationBody:
    """The body of a request, and its prompts; None = those of a split."""

    body: dict[str, Any]
    prompts: PromptSet | None


def request_body(bundle: str, options: EvaluationOptions) -> EvaluationBody:
    """Build the body of a request from its options.

    Raises:
        InvalidItems, InvalidFile, NotFound: of the prompts, with every problem of every line.
    """
    prompts = _prompt_set(options.get("prompts"))
    baseline = options.get("baseline")
    subject = (
        {"split": options.get("split", "test")}
        if prompts is None
        else {"prompts": [each.as_json() for each in prompts.prompts], "source": prompts.source}
    )
    settings = options.get("settings")
    wanted: dict[str, Any] = {
        "bundle": bundle,
        "evaluator": options.get("evaluator"),
        "settings": dict(settings) if settings else None,
        "repeats": options.get("repeats"),
        "seed": options.get("seed"),
        "baseline": None if baseline is None else identifier(baseline),
        **subject,
    }
    return EvaluationBody({name: value for name, value in wanted.items() if value is not None}, prompts)


def read_prompt_set(
    path: str, *, extra_columns: ExtraColumns = "refuse", check: PromptCheck | None = None
) -> PromptSet:
    """Read the prompts of a file, or of stdin for `-`.

    Args:
        extra_columns: treatment of unknown columns of a CSV: `refuse` or `ignore`.
        check: returns further problems of a row that can be used.

    Raises:
        InvalidItems, InvalidFile, NotFound, TooLarge, InvalidInput: as `read_evaluation_prompts`.
    """
    prompts, lines = read_evaluation_prompts(path, extra_columns=extra_columns, check=check)
    where = where_of(path)
    return PromptSet(prompts, escape(Path(where).name, lines=False), where, lines)


@contextmanager
def naming_lines(request: EvaluationBody) -> Generator[None]:
    """Let a server's `InvalidItems` about the prompts name their source and its lines."""
    try:
        yield
    except InvalidItems as error:
        known = request.prompts
        if known is None:
            raise
        raise InvalidItems(located(error.problems, known.lines), where=known.where, total=error.total) from None


def _prompt_set(prompts: Iterable[Prompt] | PromptSet | str | Path | None) -> PromptSet | None:
    if prompts is None or isinstance(prompts, PromptSet):
        return prompts
    if isinstance(prompts, str | Path):
        return read_prompt_set(str(prompts))
    raws = [{"prompt": each} if isinstance(each, str) else _raw(each) for each in prompts]
    read = read_prompts(((number, raw) for number, raw in enumerate(raws, 1)), where="prompts")
    return PromptSet(read, "prompts", "prompts", [*range(1, len(raws) + 1)])


def _raw(prompt: EvaluationPrompt | Mapping[str, object]) -> Mapping[str, object]:
    return prompt.as_json() if isinstance(prompt, EvaluationPrompt) else prompt
