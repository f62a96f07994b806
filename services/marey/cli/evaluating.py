"""Evaluations from the command line: what a request holds, and waiting until one is over."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote

import typer

from marey.cli import console
from marey.cli.options import ExtraColumns
from marey.cli.references import FORMS
from marey.core.characters import escape
from marey.core.errors import InvalidInput, ItemsFailed, MareyError, NotFound, Regressed
from marey.items.evaluation_prompts import PromptCheck
from marey.items.item import InvalidItems, Problem, outside_range, read_setting

if TYPE_CHECKING:
    from marey.client.transport import Transport

TEST = "test"
SPLITS = (TEST, "compositional", "test+compositional")
ANEW = 20
"""Repeats that a report's intervals are over: with as many motions of a prompt, each of them generates anew."""
RUN_COLUMNS = ("id", "name", "state", "regressed", "bundle", "source", "created")
COMPARISON = ("metric", "before", "after", "change", "95 % interval", "verdict")

Bundle = Annotated[str, typer.Option("--bundle", "--model", help="Model, bundle or exact bundle that generates.")]
Evaluator = Annotated[
    str | None, typer.Option("--evaluator", help="Bundle that measures; none given = the one that the server has.")
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
    typer.Option("--repeats", help="Motions of each prompt; none given = 1, and repeats draw pools out of the same."),
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
class Asked:
    """The options of a command that asks for an evaluation."""

    bundle: str
    evaluator: str | None
    split: str
    settings: Sequence[str] | None
    repeats: int | None
    seed: int | None
    baseline: str | None
    extra_columns: ExtraColumns = ExtraColumns.REFUSE
    lines: list[int | None] = field(default_factory=list[int | None], init=False)
    """Of the file's prompts, once they are read."""

    def body(self) -> dict[str, Any]:
        """The request, with the prompts of a file.

        Raises:
            InvalidItems, InvalidFile, NotFound: of the file, with every problem of every line.
            InvalidInput: of a setting.
        """
        given = {
            "bundle": self.bundle,
            "evaluator": self.evaluator,
            "settings": settings_of(self.settings or ()) or None,
            "repeats": self.repeats,
            "seed": self.seed,
            "baseline": self.baseline,
            **self._prompts(),
        }
        return {name: value for name, value in given.items() if value is not None}

    def _prompts(self) -> dict[str, Any]:
        if self.split in SPLITS:
            return {"split": self.split}
        from marey.client.rows import read_evaluation_prompts

        if self.extra_columns is ExtraColumns.TAG:
            raise InvalidInput("prompts of an evaluation have no tags", where="--extra-columns", hint="Choose ignore.")

        if self.split != "-" and not Path(self.split).suffix and not Path(self.split).exists():
            raise NotFound(
                "is neither a split of the evaluator nor a file",
                where=f"--split {self.split}",
                hint=f"Splits are {', '.join(SPLITS)}; a file of prompts ends in .csv, .jsonl or .txt.",
            )
        prompts, lines = read_evaluation_prompts(
            self.split, extra_columns=self.extra_columns.value, check=_range_check(self.bundle)
        )
        self.lines.extend(lines)
        source = "stdin" if self.split == "-" else escape(Path(self.split).name, lines=False)
        return {"prompts": [prompt.as_json() for prompt in prompts], "source": source}

    @contextmanager
    def in_source(self) -> Generator[None]:
        """In here a server's `InvalidItems` about the prompts names the file and its lines."""
        from marey.client.rows import located
        from marey.client.text_files import where_of

        try:
            yield
        except InvalidItems as error:
            if not self.lines:
                raise
            raise InvalidItems(
                located(error.problems, self.lines), where=where_of(self.split), total=error.total
            ) from None


def _range_check(bundle: str) -> PromptCheck:
    """Holds lengths against the range of a bundle, which the server is asked for at the first of them; where it does
    not tell, it checks them when it gets them."""
    found: list[dict[str, Any] | None] = []

    def model() -> dict[str, Any] | None:
        from marey.client.transport import Transport

        if not found:
            try:
                with Transport.here() as client:
                    found.append(client.get(f"/v1/models/{quote(bundle, safe='')}"))
            except MareyError:
                found.append(None)
        return found[0]

    def check(values: Mapping[str, Any], line: int | None) -> Iterator[Problem]:
        seconds: float | None = values.get("seconds")
        known = None if seconds is None else model()
        if seconds is not None and known is not None and not known["min_seconds"] <= seconds <= known["max_seconds"]:
            message = outside_range(seconds, known["min_seconds"], known["max_seconds"], known["name"])
            yield Problem(line, "seconds", message)

    return check


def watch_evaluation(
    client: Transport, evaluation: str, *, timeout: float | None = None, quiet: bool = False
) -> dict[str, Any]:
    """Look until an evaluation is over; how it ended.

    Args:
        timeout: seconds; None = for ever.
        quiet: without a progress bar.

    Raises:
        TimedOut: `timeout` passed; the evaluation goes on.
        Unreachable: the server was away for longer than `PATIENCE`.
    """
    from marey.client.watching import follow_evaluation

    hint = _wait_hint(evaluation)
    with console.goes_on(f"evaluation {evaluation}", hint), console.bar() as bar:
        bar.disable = quiet
        task = bar.add_task("", total=None)

        def look(found: dict[str, Any]) -> None:
            job = found["scoring"] or found["generation"] or {"ended": 0, "total": None}
            bar.update(task, description=_caption(found), completed=job["ended"], total=job["total"])

        return follow_evaluation(client, evaluation, timeout=timeout, hint=hint, look=look)


def check_evaluation(found: dict[str, Any], *, fail_on_regression: bool) -> None:
    """Nothing, if an evaluation that is over is done (and, where that is asked, no worse than before).

    Raises:
        ItemsFailed: it failed or was cancelled.
        Regressed: it is worse.
    """
    where = f"evaluation {found['id']}"
    if found["state"] != "done":
        raise ItemsFailed(f"{found['state']}: {found['reason']}", where=where)
    if fail_on_regression and found["regressed"]:
        raise Regressed(found["reason"], where=where, hint=f"`marey eval report {found['id']}` says what is worse.")


def repeats_of(repeats: int | None, *, regenerate: bool) -> int | None:
    """Motions of each prompt.

    Raises:
        InvalidInput: both were chosen.
    """
    if regenerate and repeats is not None:
        raise InvalidInput(f"means --repeats {ANEW}", where="--regenerate", hint="Give one of the two.")
    return ANEW if regenerate else repeats


def comparison_rows(found: dict[str, Any]) -> Iterator[tuple[object, ...]]:
    """A comparison as the rows of a table, what could be paired first."""
    for each in found["changes"]:
        change, interval = each["after"] - each["before"], f"{each['low']:+.2f} to {each['high']:+.2f}"
        numbers = (f"{each[when]:.2f}" for when in ("before", "after"))
        yield each["metric"], *numbers, f"{change:+.2f}", interval, each["verdict"]
    for each in found["others"]:
        yield (
            each["metric"],
            each["before"],
            each["after"],
            f"{each['after'] - each['before']:+.4g}",
            None,
            "not paired",
        )


def check_comparison(found: dict[str, Any], *, fail_on_regression: bool) -> None:
    """Nothing, if the later run is no worse, or that is not asked.

    Raises:
        Regressed: it is worse.
    """
    worse = [each for each in found["changes"] if each["verdict"] == "worse"]
    if fail_on_regression and worse:
        told = ", ".join(f"{each['metric']} fell from {each['before']:.1f} to {each['after']:.1f} %" for each in worse)
        raise Regressed(
            f"{told} against evaluation {found['before']['id']}",
            where=f"evaluation {found['after']['id']}",
            hint=f"`marey eval report {found['after']['id']}` shows the worst clips.",
        )


def settings_of(given: Sequence[str]) -> dict[str, float]:
    """Settings of `--set NAME=VALUE`; raises InvalidInput for something else."""
    try:
        return dict(map(read_setting, given))
    except InvalidInput as error:
        raise InvalidInput(error.message, where="--set", hint=error.hint) from None


def _caption(found: dict[str, Any]) -> str:
    return f"{found['name'] or found['id']} {found['state']}"


def _wait_hint(evaluation: str) -> str:
    return f"`marey eval wait {evaluation}` waits again; `marey eval cancel {evaluation}` ends it."


def show_runs(path: str, limit: int | None, as_json: bool, *, full_ids: bool = False, **params: Any) -> None:
    """The runs of a listing, newest first."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        found = client.pages(path, limit=console.page_size(limit), **params)
        console.listing(found, RUN_COLUMNS, _run_cell, as_json=as_json, limit=limit, full_ids=full_ids)


def _run_cell(run: dict[str, Any], column: str) -> object:
    if column == "regressed":
        return {True: "regressed", False: "no", None: None}[run[column]]
    return run["request"][column] if column in ("bundle", "source") else run[column]
