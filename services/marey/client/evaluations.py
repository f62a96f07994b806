"""Evaluations: measure models, read the reports, compare runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from marey.client.fetching import Download, check_folder, download_all
from marey.client.resources import Resource, identifier
from marey.client.rows import located, read_evaluation_prompts
from marey.client.text_files import where_of
from marey.client.types import Comparison, Evaluation, EvaluationDetail
from marey.client.watching import follow_evaluation
from marey.core.errors import InvalidInput, ItemsFailed, NotFound, Regressed
from marey.items.evaluation_prompts import EvaluationPrompt, read_prompts
from marey.items.item import InvalidItems

Split = Literal["test", "compositional", "test+compositional"]
ReportFormat = Literal["html", "json", "md"]
Prompt = EvaluationPrompt | Mapping[str, object] | str
"""A prompt, a dict with prompt, seconds and expected, or an `EvaluationPrompt`."""
WAIT_HINT = "Wait again with a longer timeout, or cancel the evaluation."


class Evaluations(Resource):
    """`client.evaluations`."""

    def run(
        self,
        bundle: str,
        *,
        split: Split = "test",
        prompts: Iterable[Prompt] | str | Path | None = None,
        evaluator: str | None = None,
        settings: Mapping[str, float] | None = None,
        repeats: int | None = None,
        seed: int | None = None,
        baseline: Evaluation | str | None = None,
        name: str | None = None,
        comment: str | None = None,
    ) -> EvaluationDetail:
        """Measure a model in the background. A retry after a lost answer begins nothing twice.

        Args:
            bundle: model, bundle or exact bundle that generates.
            split: the evaluator's own captions.
            prompts: in place of a split: prompts, or the path of a CSV or JSONL file with the columns prompt, seconds
                and expected.
            evaluator: bundle that measures; None = the one that the server has.
            settings: of sampling.
            repeats: motions of each prompt; None = 1.
            seed: of the first motion; None = 0.
            baseline: an evaluation to compare with.
            name, comment: for people.

        Raises:
            InvalidItems: with every problem of every prompt.
            NotFound, InvalidInput, Refused, Unreachable: as the server says.
        """
        read, where, lines = _read(prompts)
        wanted: dict[str, Any] = {
            "bundle": bundle,
            "evaluator": evaluator,
            "settings": dict(settings) if settings else None,
            "repeats": repeats,
            "seed": seed,
            "baseline": None if baseline is None else identifier(baseline),
            "name": name,
            "comment": comment,
            **({"split": split} if read is None else {"prompts": read, "source": where}),
        }
        body = {key: value for key, value in wanted.items() if value is not None}
        try:
            return EvaluationDetail.of(self._transport.post_new("/v1/evaluations", body))
        except InvalidItems as error:
            raise InvalidItems(located(error.problems, lines), where=where, total=error.total) from None

    def list(self, *, state: str | None = None, limit: int | None = None) -> Iterator[Evaluation]:
        """The evaluations, newest first.

        Args:
            state: only evaluations in this state.
            limit: at most so many; None = all.
        """
        return self._pages(Evaluation, "/v1/evaluations", limit, state=state)

    def get(self, evaluation: Evaluation | str) -> EvaluationDetail:
        """The evaluation as it stands now, with its numbers and history."""
        return EvaluationDetail.of(self._transport.get(_path(evaluation)))

    def wait(
        self,
        evaluation: Evaluation | str,
        *,
        timeout: float | None = None,
        on_progress: Callable[[EvaluationDetail], None] | None = None,
        fail_on_regression: bool = False,
    ) -> EvaluationDetail:
        """Wait until an evaluation is done.

        Args:
            timeout: seconds; None = no limit.
            on_progress: called with the evaluation about once a second.
            fail_on_regression: raise where it is worse than its baseline.

        Raises:
            ItemsFailed: it failed or was cancelled.
            Regressed: it is worse.
            TimedOut: `timeout` passed; the evaluation goes on.
            Unreachable: the server was away for three minutes.
        """

        def look(view: dict[str, Any]) -> None:
            if on_progress is not None:
                on_progress(EvaluationDetail.of(view))

        ended = follow_evaluation(self._transport, identifier(evaluation), timeout=timeout, hint=WAIT_HINT, look=look)
        found = EvaluationDetail.of(ended)
        where = f"evaluation {found.id}"
        if found.state != "done":
            raise ItemsFailed(f"{found.state}: {found.reason}", where=where)
        if fail_on_regression and found.regressed:
            raise Regressed(found.reason, where=where, hint="`client.evaluations.report` says what is worse.")
        return found

    def report(self, evaluation: Evaluation | str, file_format: ReportFormat = "md") -> str:
        """The report of an evaluation that is done, as text.

        Raises:
            NotFound: there is none, because it is not done.
        """
        found = self.get(evaluation)
        _report(found, file_format)
        with self._transport.stream(f"{_path(found)}/report/{file_format}") as response:
            return response.read().decode()

    def fetch_report(self, evaluation: Evaluation | str, path: str | Path, *, overwrite: bool = False) -> Path:
        """Fetch the report into a file, checked by its sha256; the ending says which: `.html`, `.json`, `.md`.

        Raises:
            InvalidInput: another ending.
            NotFound: there is none, because it is not done.
            Conflict: a file is there and holds something else.
        """
        path, found = Path(path), self.get(evaluation)
        file_format = path.suffix.lower().removeprefix(".")
        if file_format not in ("html", "json", "md"):
            raise InvalidInput("the file's ending is no report's", where=str(path), hint="Use html, json or md.")
        file = _report(found, file_format)
        check_folder(path.parent)
        download = Download(f"{_path(found)}/report/{file_format}", file.sha256, file.size, path)
        download_all(self._transport, [download], overwrite=overwrite, done=lambda _: None)
        return path

    def compare(self, before: Evaluation | str, after: Evaluation | str) -> Comparison:
        """Compare two evaluations of the same prompts and evaluator, motion against motion, by paired bootstrap."""
        return Comparison.of(self._transport.get(f"{_path(after)}/comparison", before=identifier(before)))

    def cancel(self, evaluation: Evaluation | str) -> EvaluationDetail:
        """Cancel an evaluation and the jobs that work for it; what was made stays."""
        self._transport.delete(_path(evaluation))
        return self.get(evaluation)


def _read(prompts: Iterable[Prompt] | str | Path | None) -> tuple[Any, str | None, list[int | None]]:
    """The prompts of a request, their source, and the line of each."""
    if prompts is None:
        return None, None, []
    if isinstance(prompts, str | Path):
        read, lines = read_evaluation_prompts(str(prompts))
        return [prompt.as_json() for prompt in read], Path(where_of(str(prompts))).name, lines
    raws = [{"prompt": each} if isinstance(each, str) else _raw(each) for each in prompts]
    read = read_prompts(((number, raw) for number, raw in enumerate(raws, 1)), where="prompts")
    return [prompt.as_json() for prompt in read], "prompts", [*range(1, len(raws) + 1)]


def _raw(prompt: EvaluationPrompt | Mapping[str, object]) -> Mapping[str, object]:
    return prompt.as_json() if isinstance(prompt, EvaluationPrompt) else prompt


def _report(found: EvaluationDetail, file_format: str) -> Any:
    file = next((file for file in found.reports if file.format == file_format), None)
    if file is None:
        message = f"there is no such report: the evaluation is {found.state}"
        raise NotFound(message, where=f"evaluation {found.id}", hint=found.reason)
    return file


def _path(evaluation: Evaluation | str) -> str:
    return f"/v1/evaluations/{identifier(evaluation)}"
