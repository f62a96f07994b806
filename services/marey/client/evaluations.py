"""Evaluations: measure models, read the reports, compare runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, Unpack, get_args

from marey.client.downloads import download_all
from marey.client.evaluation_requests import EvaluationOptions, naming_lines, request_body
from marey.client.fetching import check_folder
from marey.client.file_to_fetch import FileToFetch
from marey.client.resources import Resource, identifier
from marey.client.types.common import File
from marey.client.types.evaluations import Comparison, Evaluation, EvaluationDetail
from marey.client.watching import follow_evaluation
from marey.core.errors import InvalidInput, ItemsFailed, NotFound, Regressed

ReportFormat = Literal["html", "json", "md"]
WAIT_HINT = "Wait again with a longer timeout, or cancel the evaluation."


class Evaluations(Resource):
    """`client.evaluations`. Errors of all methods: NotFound, InvalidInput, Refused, Unreachable."""

    def run(
        self,
        bundle: str,
        *,
        name: str | None = None,
        comment: str | None = None,
        **options: Unpack[EvaluationOptions],
    ) -> EvaluationDetail:
        """Measure a model in the background. A retry after a lost answer starts nothing twice.

        Args:
            bundle: model, bundle or exact bundle that generates.
            name, comment: for people.
            options: the prompts and settings, as `EvaluationOptions` describes them: `split` (captions of the
                evaluator's bundle, `test` by default) or `prompts` (a list, or the path of a CSV or JSONL file),
                `evaluator`, `settings`, `repeats`, `seed`, `baseline`.

        Raises:
            InvalidItems: with every problem of every prompt.
            InvalidFile, NotFound, TooLarge: of the file of prompts.
            InvalidInput: an option cannot be used.
        """
        request = request_body(bundle, options)
        body = {**request.body, **({"name": name} if name else {}), **({"comment": comment} if comment else {})}
        with naming_lines(request):
            return EvaluationDetail.of(self._transport.post_new("/v1/evaluations", body))

    def list(
        self, *, state: str | None = None, limit: int | None = None, page_size: int | None = None
    ) -> Iterator[Evaluation]:
        """Iterate over the evaluations, newest first.

        Args:
            state: only evaluations in this state.
            limit: the largest number of evaluations; None = all.
            page_size: evaluations of each request, at most 1,000; None = as many as the limit allows.
        """
        return self._pages(Evaluation, "/v1/evaluations", limit, page_size, state=state)

    def get(self, evaluation: Evaluation | str) -> EvaluationDetail:
        """Return the current state of an evaluation, with its figures and history."""
        return EvaluationDetail.of(self._transport.get(_path(evaluation)))

    def wait(
        self,
        evaluation: Evaluation | str,
        *,
        timeout: float | None = None,
        on_progress: Callable[[EvaluationDetail], None] | None = None,
        check: bool = True,
        fail_on_regression: bool = False,
    ) -> EvaluationDetail:
        """Wait until an evaluation has ended, and return it.

        Args:
            timeout: seconds; None = no limit.
            on_progress: called with the evaluation about once a second.
            check: raise if it failed or was cancelled.
            fail_on_regression: raise if it is worse than its baseline.

        Raises:
            ItemsFailed: it failed or was cancelled.
            Regressed: it is worse.
            TimedOut: `timeout` passed; the evaluation continues.
            Unreachable: the server was away for three minutes.
        """

        def look(view: dict[str, Any]) -> None:
            if on_progress is not None:
                on_progress(EvaluationDetail.of(view))

        ended = follow_evaluation(self._transport, identifier(evaluation), timeout=timeout, hint=WAIT_HINT, look=look)
        found = EvaluationDetail.of(ended)
        where = f"evaluation {found.id}"
        if check and found.state != "done":
            raise ItemsFailed(f"{found.state}: {found.reason}", where=where)
        if fail_on_regression and found.regressed:
            raise Regressed(found.reason, where=where, hint="`client.evaluations.report` says what is worse.")
        return found

    def report(self, evaluation: Evaluation | str, file_format: ReportFormat = "md") -> str:
        """Return the report of an evaluation as text.

        Args:
            file_format: html, json or md.

        Raises:
            NotFound: the evaluation is not done.
        """
        found = self.get(evaluation)
        _report(found, file_format)
        with self._transport.stream(f"{_path(found)}/report/{file_format}") as response:
            return response.read().decode()

    def fetch_report(self, evaluation: Evaluation | str, path: str | Path, *, overwrite: bool = False) -> Path:
        """Fetch the report into a file, verified by its sha256.

        Args:
            path: its ending names the format: `.html`, `.json` or `.md`.
            overwrite: replace a file with other content.

        Raises:
            InvalidInput: another ending, or a folder that cannot be written.
            NotFound: the evaluation is not done.
            Conflict: the file exists with other content.
            InvalidFile: the data that arrived has another sha256.
        """
        path = Path(path)
        file_format = report_format(path)
        found = self.get(evaluation)
        file = _report(found, file_format)
        check_folder(path.parent)
        download = FileToFetch(f"{_path(found)}/report/{file_format}", file.sha256, file.size, path)
        download_all(self._transport, [download], overwrite=overwrite, done=lambda _: None)
        return path

    def compare(self, before: Evaluation | str, after: Evaluation | str) -> Comparison:
        """Compare two evaluations of the same prompts and evaluator, motion by motion, by paired bootstrap.

        Raises:
            Conflict: they are not done, or differ in prompts or evaluator.
        """
        return Comparison.of(self._transport.get(f"{_path(after)}/comparison", before=identifier(before)))

    def cancel(self, evaluation: Evaluation | str) -> EvaluationDetail:
        """Cancel an evaluation and its jobs; finished motions stay."""
        self._transport.delete(_path(evaluation))
        return self.get(evaluation)


def report_format(path: Path) -> ReportFormat:
    """Return the format of a report that a file's ending names.

    Raises:
        InvalidInput: another ending.
    """
    ending = path.suffix.lower().removeprefix(".")
    for file_format in get_args(ReportFormat):
        if ending == file_format:
            return file_format
    raise InvalidInput("unknown report format", where=str(path), hint=f"Use {', '.join(get_args(ReportFormat))}.")


def _report(found: EvaluationDetail, file_format: str) -> File:
    file = next((file for file in found.reports if file.format == file_format), None)
    if file is None:
        message = f"the report does not exist: the evaluation is {found.state}"
        raise NotFound(message, where=f"evaluation {found.id}", hint=found.reason)
    return file


def _path(evaluation: Evaluation | str) -> str:
    return f"/v1/evaluations/{identifier(evaluation)}"
