"""Jobs: submit prompts, follow, change and fetch them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack

from marey.client.fetching import Download, FetchObserver, fetch_job
from marey.client.lines import Lines
from marey.client.names import DEFAULT_TEMPLATE, check_template
from marey.client.resources import Resource, identifier
from marey.client.rows import Format, PromptReader, defaults_of, read_file, read_rows
from marey.client.tables import ExtraColumns
from marey.client.types import CheckedJob, Counters, Erasure, Job, JobEvent, JobItem, QueuePosition
from marey.client.watching import follow_job
from marey.core.errors import InvalidInput, ItemsFailed
from marey.items.item import Item

Row = Item | Mapping[str, object] | str
"""A prompt, a dict with the columns of a file, or an `Item`."""
WAIT_HINT = "Wait again with a longer timeout, or cancel the job."


class Defaults(TypedDict, total=False):
    """Fields of rows that do not say otherwise."""

    model: str | None
    bundle: str | None
    seconds: float | None
    seed: int | None
    variants: int | None
    fps: float | None
    tags: Sequence[str] | None


class JobChanges(TypedDict, total=False):
    """Changes of a job; None removes the comment or the share of failures."""

    priority: int
    comment: str | None
    fail_early: float | None


@dataclass(frozen=True, kw_only=True)
class Progress:
    """A job under way.

    Attributes:
        state: of the job.
        done: items that are not open any more.
        total: items.
        counters: items in each state.
        event: the event that brought it; None = the job was asked for.
    """

    state: str
    done: int
    total: int
    counters: Counters
    event: JobEvent | None = None


@dataclass(frozen=True, kw_only=True)
class FetchedItem:
    """An item of a fetched job.

    Attributes:
        item: with its motion, if it has one.
        files: paths by format; empty where no motion was made.
    """

    item: JobItem
    files: Mapping[str, Path]


OnProgress = Callable[[Progress], None]
OnFetched = Callable[[int, int], None]
"""Called with the numbers of fetched files and of all files."""


class Jobs(Resource):
    """`client.jobs`."""

    def submit(
        self,
        rows: Iterable[Row],
        *,
        name: str | None = None,
        comment: str | None = None,
        priority: int = 0,
        fail_early: float | None = None,
        keep_days: int | None = None,
        idempotency_key: str | None = None,
        **defaults: Unpack[Defaults],
    ) -> Job:
        """Submit prompts as a job. A retry after a lost answer submits nothing twice.

        Args:
            rows: prompts, dicts with the fields of an item, or items.
            name, comment: of the job.
            priority: -1000 to 1000; higher runs first.
            fail_early: cancel the rest once this share (0 to 1) has failed.
            keep_days: delete the job, motions and all, this long after its end.
            idempotency_key: of all attempts; None = one is drawn. Give one of your own to submit at most once even if
                your program is run again.
            defaults: fields of rows that do not say otherwise: model, bundle, seconds, seed, variants, fps, tags.

        Raises:
            InvalidItems: with every problem of every row; nothing was submitted.
            InvalidInput: there is no row, or a default cannot be used.
            TooLarge, Busy, QuotaUsedUp, Refused, Unreachable: as the server says.
        """
        return self._submit(
            read_rows(_raws(rows), _defaults(defaults)),
            idempotency_key,
            name=name,
            comment=comment,
            priority=priority or None,
            fail_early=fail_early,
            keep_days=keep_days,
        )

    def submit_file(
        self,
        path: str | Path,
        *,
        file_format: Format | None = None,
        extra_columns: ExtraColumns = "refuse",
        name: str | None = None,
        comment: str | None = None,
        priority: int = 0,
        fail_early: float | None = None,
        keep_days: int | None = None,
        idempotency_key: str | None = None,
        **defaults: Unpack[Defaults],
    ) -> Job:
        """Submit a file of prompts as a job; see `submit`.

        Args:
            path: `.csv` with a header line, `.jsonl` with an object a line, `.txt` with a prompt a line, each also
                packed as `.gz`, or `-` for stdin.
            file_format: csv, jsonl or txt, where the ending does not tell.
            extra_columns: unknown columns of a CSV: `refuse`, `tag` (a tag column=value of the row) or `ignore`.

        Raises:
            NotFound, InvalidFile, TooLarge: of the file.
            InvalidItems: with the line of every problem; nothing was submitted.
        """
        return self._submit(
            read_file(str(path), file_format, _defaults(defaults), extra_columns),
            idempotency_key,
            name=name,
            comment=comment,
            priority=priority or None,
            fail_early=fail_early,
            keep_days=keep_days,
        )

    def check(self, rows: Iterable[Row], **defaults: Unpack[Defaults]) -> CheckedJob:
        """Check prompts as `submit` does, and submit nothing: how many motions, with which bundles, in what time."""
        return CheckedJob.of(self._send(read_rows(_raws(rows), _defaults(defaults)), validate_only=True))

    def check_file(
        self,
        path: str | Path,
        *,
        file_format: Format | None = None,
        extra_columns: ExtraColumns = "refuse",
        **defaults: Unpack[Defaults],
    ) -> CheckedJob:
        """Check a file of prompts as `submit_file` does, and submit nothing."""
        reader = read_file(str(path), file_format, _defaults(defaults), extra_columns)
        return CheckedJob.of(self._send(reader, validate_only=True))

    def list(
        self, *, state: str | None = None, limit: int | None = None, page_size: int | None = None
    ) -> Iterator[Job]:
        """The jobs, newest first, page after page.

        Args:
            state: only jobs in this state.
            limit: at most so many; None = all.
            page_size: of each request, at most 1,000; None = as large as the limit allows.
        """
        return self._pages(Job, "/v1/jobs", limit, page_size, state=state)

    def get(self, job: Job | str) -> Job:
        """The job as it stands now."""
        return Job.of(self._transport.get(_path(job)))

    def queue(self, job: Job | str) -> QueuePosition:
        """The job's place in the queue, and an estimate of when it is done."""
        return QueuePosition.of(self._transport.get(f"{_path(job)}/queue"))

    def items(
        self,
        job: Job | str,
        *,
        state: str | None = None,
        review: str | None = None,
        limit: int | None = None,
        page_size: int | None = None,
    ) -> Iterator[JobItem]:
        """The items of a job in input order, each with its motion if it has one.

        Args:
            state: only items in this state.
            review: only items whose motion has this verdict.
        """
        return self._pages(JobItem, f"{_path(job)}/items", limit, page_size, state=state, review=review)

    def pause(self, job: Job | str, *, reason: str | None = None) -> Job:
        """Stop giving out items of the job; those being made are finished."""
        return self._act(job, "pause", reason=reason)

    def resume(self, job: Job | str, *, reason: str | None = None) -> Job:
        """Go on with a paused job."""
        return self._act(job, "resume", reason=reason)

    def cancel(self, job: Job | str, *, reason: str | None = None) -> Job:
        """Cancel the items that are not done yet; what is done stays."""
        return self._act(job, "cancel", reason=reason)

    def retry(self, job: Job | str, *, failed_only: bool = False, reason: str | None = None) -> Job:
        """Try failed, dead and (unless `failed_only`) cancelled items again."""
        return self._act(job, "retry", failed_only=failed_only or None, reason=reason)

    def update(self, job: Job | str, *, reason: str | None = None, **changes: Unpack[JobChanges]) -> Job:
        """Change a job.

        Args:
            reason: stands in the job's events.
            changes: priority, comment (None removes it), fail_early (None = never).
        """
        return Job.of(self._transport.patch(_path(job), changes, reason=reason))

    def erase(self, job: Job | str) -> Erasure:
        """Erase the prompts of an ended job for good; its motions, names and tags stay."""
        return Erasure.of(self._transport.post(f"{_path(job)}/erase"))

    def delete(self, job: Job | str) -> None:
        """Delete an ended job with its motions."""
        self._transport.delete(_path(job))

    def watch(self, job: Job | str, *, timeout: float | None = None) -> Iterator[Progress]:
        """The progress of a job, as it comes, until the job has ended; lost connections are taken up where they broke.

        Args:
            timeout: seconds; None = no limit.

        Raises:
            TimedOut: `timeout` passed; the job goes on.
            Unreachable: the server was away for three minutes.
        """
        for view, event in follow_job(self._transport, identifier(job), timeout=timeout, hint=WAIT_HINT):
            yield _progress(view, event)

    def wait(
        self, job: Job | str, *, timeout: float | None = None, on_progress: OnProgress | None = None, check: bool = True
    ) -> Job:
        """Wait until a job has ended; the job as it ended.

        Args:
            timeout: seconds; None = no limit.
            on_progress: called with each change.
            check: raise where items have no result.

        Raises:
            ItemsFailed: some failed, died or were cancelled.
            TimedOut, Unreachable: as `watch`.
        """
        ended: Mapping[str, Any] = {}
        for view, event in follow_job(self._transport, identifier(job), timeout=timeout, hint=WAIT_HINT):
            ended = view
            if on_progress is not None:
                on_progress(_progress(view, event))
        found = Job.of(ended)
        if check and found.state != "succeeded":
            of_each = found.counters
            raise ItemsFailed(
                f"{of_each.failed} failed, {of_each.dead} dead, {of_each.cancelled} cancelled of {found.total} items",
                where=f"job {found.id}",
                hint="`client.jobs.items(job)` has the error of each; `client.jobs.retry(job)` tries them again.",
            )
        return found

    def events(self, job: Job | str, *, after: int = 0) -> Iterator[JobEvent]:
        """The events of a job as they happen. Ends with the job, or with the connection: `watch` goes on by itself.

        Args:
            after: the `seq` of the last event that is known.
        """
        for event in self._transport.events(identifier(job), after):
            yield JobEvent.of(event)

    def fetch(
        self,
        job: Job | str,
        folder: str | Path,
        *,
        formats: Sequence[str] | None = None,
        name_template: str = DEFAULT_TEMPLATE,
        review: Literal["kept", "rejected", "rerolled"] | None = None,
        prune: bool = False,
        overwrite: bool = False,
        on_progress: OnFetched | None = None,
    ) -> Sequence[FetchedItem]:
        """Fetch the motions that a job has made so far, eight files at a time, with a `manifest.csv` beside them.

        Files that are there are not fetched again, half-fetched ones are continued, and each is checked by its sha256.

        Args:
            folder: made if it is not there.
            formats: as bvh and npz; None = all there are.
            name_template: of the paths, from `{index} {name} {prompt} {seed} {variant} {model} {bundle} {job} {tags}`.
            review: only motions with this verdict.
            prune: remove files of earlier fetches of the job that are not among these.
            overwrite: replace files that hold something else.
            on_progress: called with the numbers of fetched files and of all; one call at a time, from any thread.

        Returns:
            The items in input order, also those without a motion.

        Raises:
            Conflict: a file is there and holds something else, or a format was not made; nothing is fetched then.
            InvalidFile: what arrived has another sha256, or cannot be written.
            InvalidInput: the folder cannot be written, or two motions would have one name.
            Unreachable: the connection breaks again and again; fetching once more goes on.
        """
        planned, _ = fetch_job(
            self._transport,
            identifier(job),
            Path(folder),
            formats,
            template=check_template(name_template),
            review=review,
            prune=prune,
            overwrite=overwrite,
            observer=None if on_progress is None else _Counting(on_progress),
        )
        return [
            FetchedItem(item=JobItem.of(item), files={file.url.rpartition("/")[2]: file.path for file in files})
            for item, files in planned
        ]

    def _submit(self, reader: PromptReader, idempotency_key: str | None, **params: Any) -> Job:
        return Job.of(self._send(reader, idempotency_key=idempotency_key, **params))

    def _send(self, reader: PromptReader, **params: Any) -> Any:
        with Lines(item.as_json() for item in reader) as lines:
            if reader.total:
                raise reader.error()
            with reader.in_source():
                return self._transport.submit(lines, **params)

    def _act(self, job: Job | str, verb: str, **params: Any) -> Job:
        return Job.of(self._transport.post(f"{_path(job)}/{verb}", **params))


class _Counting(FetchObserver):
    """Counts fetched files."""

    def __init__(self, told: OnFetched) -> None:
        self._told = told
        self._lock = threading.Lock()
        self._done = self._total = 0

    def planned(self, total: int) -> None:
        self._total = total
        self._told(0, total)

    def fetched(self, download: Download) -> None:
        with self._lock:
            self._done += 1
            self._told(self._done, self._total)


def _defaults(defaults: Defaults) -> Mapping[str, object]:
    """The checked defaults; errors name the argument."""
    try:
        return defaults_of(**defaults)
    except InvalidInput as error:
        raise InvalidInput(error.message, where=(error.where or "").removeprefix("--"), hint=error.hint) from None


def _raws(rows: Iterable[Row]) -> Iterator[object]:
    for row in rows:
        if isinstance(row, str):
            yield {"prompt": row}
        else:
            yield row.as_json() if isinstance(row, Item) else row


def _path(job: Job | str) -> str:
    return f"/v1/jobs/{identifier(job)}"


def _progress(view: Mapping[str, Any], event: Mapping[str, Any] | None) -> Progress:
    now = view if event is None else event["data"]
    counters = Counters.of(now["counters"])
    done = counters.succeeded + counters.failed + counters.dead + counters.cancelled
    told = None if event is None else JobEvent.of(event)
    return Progress(state=now["state"], done=done, total=view["total"], counters=counters, event=told)
