"""Evaluations from the command line: the options of a request, and waiting until a run ends."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from marey.cli import console
from marey.cli.hints import hint_of_timeout
from marey.cli.options import settings_of
from marey.cli.references import FORMS, find
from marey.client.tables import ExtraColumns
from marey.core.errors import InvalidInput, ItemsFailed, MareyError, NotFound, Regressed
from marey.items.evaluation_prompts import PromptCheck
from marey.items.problems import Problem
from marey.items.values import outside_range

if TYPE_CHECKING:
    from marey.client import Client, Comparison, Evaluation, EvaluationDetail, Model
    from marey.client.evaluation_requests import EvaluationOptions, PromptSet

TEST = "test"
SPLITS: tuple[Literal["test", "compositional", "test+compositional"], ...] = (
    "test", "compositional", "test+compositional",
)  # fmt: skip
ANEW = 20
"""Repeats of a report's intervals; with as many motions of each prompt, every repeat generates its own."""
RUN_COLUMNS = ("id", "name", "state", "regressed", "bundle", "source", "created")
COMPARISON = ("metric", "before", "after", "change", "95 % interval", "verdict")

Bundle = Annotated[str, typer.Option("--bundle", "--model", help="Model, bundle or exact bundle that generates.")]
Evaluator = Annotated[
    str | None, typer.Option("--evaluator", help="Bundle that measures; none given = the one that the server has.")
]
Evaluators = Annotated[
    list[str] | None,
    typer.Option(
        "--evaluator",
        help="Bundle that measures; none given = the one that the server has. With --protocol it may be repeated.",
    ),
]
Split = Annotated[
    str,
    typer.Option(
        "--split",
        metavar="SPLIT|FILE",
        help=f"The evaluator's own captions ({', '.join(SPLITS)}), or a CSV or JSONL file.",
    ),
]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Of sampling; may be repeated.")
]
Extra = Annotated[
    ExtraColumns,
    typer.Option("--extra-columns", help="Columns of the CSV that are not known: refuse or ignore them."),
]
Repeats = Annotated[
    int | None,
    typer.Option("--repeats", help="Motions of each prompt; default 1: all 20 repeats draw from the same motions."),
]
Regenerate = Annotated[
    bool, typer.Option("--regenerate", help=f"Generate anew in all {ANEW} repeats: as --repeats {ANEW}, and as long.")
]
Seed = Annotated[int | None, typer.Option("--seed", help="Seed of the first motion; none given = 0.")]
Baseline = Annotated[
    str | None, typer.Option("--baseline", metavar="RUN", help=f"An evaluation to compare with: {FORMS}.")
]
Timeout = Annotated[float | None, typer.Option("--timeout", help="Seconds to wait at most; then exit 7.")]
FailOnRegression = Annotated[
    bool, typer.Option("--fail-on-regression", help="Wait; exit 8 when it is worse than what it is compared with.")
]


@dataclass(frozen=True)
class EvaluationArguments:
    """The options of a command that requests an evaluation."""

    bundle: str
    evaluator: str | None
    split: str
    settings: Sequence[str] | None
    repeats: int | None
    seed: int | None
    baseline: str | None
    extra_columns: ExtraColumns = "refuse"

    def options(self) -> EvaluationOptions:
        """Return the arguments of the client, with the prompts of a file, but without the baseline.

        Raises:
            InvalidItems, InvalidFile, NotFound: of the file, with every problem of every line.
            InvalidInput: of a setting.
        """
        options: EvaluationOptions = {
            "evaluator": self.evaluator,
            "settings": settings_of(self.settings or ()),
            "repeats": self.repeats,
            "seed": self.seed,
        }
        for split in SPLITS:
            if self.split == split:
                return {**options, "split": split}
        return {**options, "prompts": self._prompts()}

    def baseline_of(self, client: Client) -> str | None:
        """Return the id of the baseline; None = none."""
        return None if self.baseline is None else find(client, "evaluation", self.baseline).id

    def _prompts(self) -> PromptSet:
        from marey.client.evaluation_requests import read_prompt_set

        if self.extra_columns == "tag":
            raise InvalidInput("prompts of an evaluation have no tags", where="--extra-columns", hint="Choose ignore.")
        if self.split != "-" and not Path(self.split).suffix and not Path(self.split).exists():
            raise NotFound(
                "is neither a split of the evaluator nor a file",
                where=f"--split {self.split}",
                hint=f"Splits are {', '.join(SPLITS)}; a file of prompts ends in .csv, .jsonl or .txt.",
            )
        check = _range_check(self.bundle)
        return read_prompt_set(self.split, extra_columns=self.extra_columns, check=check)


def _range_check(bundle: str) -> PromptCheck:
    """Return a check of lengths against the range of a bundle, which the server is asked for at the first length. Where
    it cannot be asked, it checks them when it gets them."""
    found: list[Model | None] = []

    def model() -> Model | None:
        from marey.client import Client

        if not found:
            try:
                with Client() as client:
                    found.append(client.models.get(bundle))
            except MareyError:
                found.append(None)
        return found[0]

    def check(values: Mapping[str, Any], line: int | None) -> Iterator[Problem]:
        seconds: float | None = values.get("seconds")
        known = None if seconds is None else model()
        if seconds is not None and known is not None and not known.min_seconds <= seconds <= known.max_seconds:
            message = outside_range(seconds, known.min_seconds, known.max_seconds, known.name)
            yield Problem(line, "seconds", message)

    return check


def watch_evaluation(client: Client, evaluation: str, *, timeout: float | None = None) -> EvaluationDetail:
    """Wait until an evaluation has ended, with a progress bar, and return it.

    Args:
        timeout: seconds; None = no limit.

    Raises:
        TimedOut: `timeout` passed; the evaluation continues.
        Unreachable: the server was away for three minutes.
    """
    hint = _wait_hint(evaluation)
    with console.goes_on(f"evaluation {evaluation}", hint), hint_of_timeout(hint), console.bar() as bar:
        task = bar.add_task("", total=None)

        def show(found: EvaluationDetail) -> None:
            job = found.scoring or found.generation
            done, total = (0, None) if job is None else (job.ended, job.total)
            bar.update(task, description=f"{found.name or found.id} {found.state}", completed=done, total=total)

        return client.evaluations.wait(evaluation, timeout=timeout, on_progress=show, check=False)


def check_evaluation(found: EvaluationDetail, *, fail_on_regression: bool) -> None:
    """Check that an evaluation that has ended is done and, if wanted, no worse than its baseline.

    Raises:
        ItemsFailed: it failed or was cancelled.
        Regressed: it is worse.
    """
    where = f"evaluation {found.id}"
    if found.state != "done":
        raise ItemsFailed(f"{found.state}: {found.reason}", where=where)
    if fail_on_regression and found.regressed:
        raise Regressed(found.reason, where=where, hint=f"`marey eval report {found.id}` says what is worse.")


def repeats_of(repeats: int | None, *, regenerate: bool) -> int | None:
    """Motions of each prompt.

    Raises:
        InvalidInput: both were chosen.
    """
    if regenerate and repeats is not None:
        raise InvalidInput(f"means --repeats {ANEW}", where="--regenerate", hint="Give one of the two.")
    return ANEW if regenerate else repeats


def refuse_given(options: Mapping[str, object], reason: str) -> None:
    """Refuse options that have no meaning here.

    Raises:
        InvalidInput: one of them is given.
    """
    for name, value in options.items():
        if value:
            raise InvalidInput(reason, where=name)


def single_of(evaluators: Sequence[str] | None) -> str | None:
    """Return the one evaluator that the server measures with; None = the server's own.

    Raises:
        InvalidInput: several were given.
    """
    if evaluators and len(evaluators) > 1:
        raise InvalidInput("the server measures with one evaluator", where="--evaluator")
    return evaluators[0] if evaluators else None


def comparison_rows(found: Comparison) -> Iterator[tuple[object, ...]]:
    """Yield the rows of a comparison's table, the paired metrics first."""
    for each in found.changes:
        change, interval = each.after - each.before, f"{each.low:+.2f} to {each.high:+.2f}"
        yield each.metric, f"{each.before:.2f}", f"{each.after:.2f}", f"{change:+.2f}", interval, each.verdict
    for each in found.others:
        yield each.metric, each.before, each.after, f"{each.after - each.before:+.4g}", None, "not paired"


def check_comparison(found: Comparison, *, fail_on_regression: bool) -> None:
    """Check, if wanted, that the later run is no worse.

    Raises:
        Regressed: it is worse.
    """
    worse = [each for each in found.changes if each.verdict == "worse"]
    if fail_on_regression and worse:
        fell = ", ".join(f"{each.metric} fell from {each.before:.1f} to {each.after:.1f} %" for each in worse)
        raise Regressed(
            f"{fell} against evaluation {found.before.id}",
            where=f"evaluation {found.after.id}",
            hint=f"`marey eval report {found.after.id}` shows the worst clips.",
        )


def show_runs(found: Iterable[Evaluation], limit: int | None, as_json: bool, *, full_ids: bool = False) -> None:
    """Print evaluations as a listing."""
    console.listing(
        (each.raw for each in found), RUN_COLUMNS, _run_cell, as_json=as_json, limit=limit, full_ids=full_ids
    )


def regressed_cell(regressed: bool | None) -> str | None:
    """Return the cell of a table for a comparison with the baseline."""
    return {True: "regressed", False: "no", None: None}[regressed]


def _wait_hint(evaluation: str) -> str:
    return f"`marey eval wait {evaluation}` waits again; `marey eval cancel {evaluation}` ends it."


def _run_cell(run: Mapping[str, Any], column: str) -> object:
    if column == "regressed":
        return regressed_cell(run[column])
    return run["request"][column] if column in ("bundle", "source") else run[column]
