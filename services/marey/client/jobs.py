"""Jobs: submit prompts, follow, change and fetch them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Unpack

from marey.client.fetching import FetchObserver, fetch_job
from marey.client.job_requests import Defaults, JobChanges, JobOptions, Row, raw_items, sent_options, sent_scope
from marey.client.job_results import FetchCounter, FetchedItem, OnFetched, OnProgress, Progress, progress_of
from marey.client.lines import Lines
from marey.client.names import DEFAULT_TEMPLATE, check_template
from marey.client.resources import Resource, identifier
from marey.client.rows import Format, PromptReader, defaults_of, read_file, read_rows
from marey.client.tables import ExtraColumns
from marey.client.types.jobs import (
    CheckedJob,
    Erasure,
    Job,
    JobEvent,
    JobItem,
    QualityCounts,
    QueuePosition,
    SubmittedJob,
)
from marey.client.watching import follow_job
from marey.core.errors import ItemsFailed
from marey.motion.export_options import BvhRoot, ExportOptions, InPlace, Names, Placement, RestPose
from marey.vocabulary.scope import ScopePolicy

WAIT_HINT = "Wait again with a longer timeout, or cancel the job."

ReviewName = Literal["kept", "rejected", "rerolled"]


class Jobs(Resource):
    """`client.jobs`. Errors of all methods: NotFound, InvalidInput, Conflict, Refused, Unreachable."""

    def submit(
        self,
        rows: Iterable[Row],
        *,
        name: str | None = None,
        comment: str | None = None,
        priority: int = 0,
        fail_early: float | None = None,
        keep_days: int | None = None,
        scope: ScopePolicy = "warn",
        idempotency_key: str | None = None,
        **defaults: Unpack[Defaults],
    ) -> SubmittedJob:
        """Submit prompts as a job. A retry after a lost answer submits nothing twice.

        Args:
            rows: prompts, dicts with the fields of an item, or items.
            name, comment: of the job.
            priority: -1000 to 1000; higher runs first.
            fail_early: cancel open items once this share (0 to 1) has failed; None = never.
            keep_days: delete the job with its motions this many days after its end; None = the server's default.
            scope: treatment of prompts with actions that the model does not know: accepted, with `warnings` of the job
                (`warn`), refused (`refuse`), or not examined (`ignore`).
            idempotency_key: of all attempts; None = random. Give your own key to submit at most once even if your
                program runs again.
            defaults: fields of rows that do not set them: model, bundle, seconds, seed, variants, fps,
                best_of, redraws, variety, tags,
                settings (of sampling, by name).

        Raises:
            InvalidItems: with every problem of every row; nothing was submitted.
            OutOfScope: scope `refuse`, with every prompt that the model does not know; nothing was submitted.
            InvalidInput: there is no row, or a default cannot be used.
            TooLarge, Busy, QuotaUsedUp, Refused, Unreachable: as the server says.
        """
        return self._submit(
            read_rows(raw_items(rows), defaults_of(**defaults)),
            idempotency_key,
            name=name,
            comment=comment,
            priority=priority or None,
            fail_early=fail_early,
            keep_days=keep_days,
            scope=sent_scope(scope),
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
        scope: ScopePolicy = "warn",
        idempotency_key: str | None = None,
        **defaults: Unpack[Defaults],
    ) -> SubmittedJob:
        """Submit a file of prompts as a job; see `submit`.

        Args:
            path: `.csv` with a header line, `.jsonl` with an object a line, `.txt` with a prompt a line, each also
                packed as `.gz`, or `-` for stdin.
            file_format: csv, jsonl or txt; None = by the ending.
            extra_columns: treatment of unknown columns of a CSV: `refuse`, `tag` (a tag column=value of the row) or
                `ignore`.

        Raises:
            NotFound, InvalidFile, TooLarge: of the file.
            InvalidItems: with the line of every problem; nothing was submitted.
        """
        return self._submit(
            read_file(str(path), file_format, defaults_of(**defaults), extra_columns),
            idempotency_key,
            name=name,
            comment=comment,
            priority=priority or None,
            fail_early=fail_early,
            keep_days=keep_days,
            scope=sent_scope(scope),
        )

    def submit_lines(self, lines: Lines, **options: Unpack[JobOptions]) -> SubmittedJob:
        """Submit items that were read and checked before; see `submit`.

        Args:
            lines: one item a line, as JSON.
            options: name, comment, priority, fail_early, keep_days, scope.
        """
        return SubmittedJob.of(self._transport.submit(lines, **sent_options(options)))

    def check_lines(self, lines: Lines, **options: Unpack[JobOptions]) -> CheckedJob:
        """Check what `submit_lines` would submit, and submit nothing."""
        return CheckedJob.of(self._transport.submit(lines, validate_only=True, **sent_options(options)))

    def check(self, rows: Iterable[Row], **defaults: Unpack[Defaults]) -> CheckedJob:
        """Check prompts as `submit` does, and submit nothing; the result has the number of motions and an estimate."""
        return CheckedJob.of(self._send(read_rows(raw_items(rows), defaults_of(**defaults)), validate_only=True))

    def check_file(
        self,
        path: str | Path,
        *,
        file_format: Format | None = None,
        extra_columns: ExtraColumns = "refuse",
        **defaults: Unpack[Defaults],
    ) -> CheckedJob:
        """Check a file of prompts as `submit_file` does, and submit nothing."""
        reader = read_file(str(path), file_format, defaults_of(**defaults), extra_columns)
        return CheckedJob.of(self._send(reader, validate_only=True))

    def list(
        self, *, state: str | None = None, limit: int | None = None, page_size: int | None = None
    ) -> Iterator[Job]:
        """Iterate over the jobs, newest first.

        Args:
            state: only jobs in this state.
            limit: the largest number of jobs; None = all.
            page_size: jobs of each request, at most 1,000; None = as many as the limit allows.
        """
        return self._pages(Job, "/v1/jobs", limit, page_size, state=state)

    def get(self, job: Job | str) -> Job:
        """Return the current state of a job."""
        return Job.of(self._transport.get(_path(job)))

    def queue(self, job: Job | str) -> QueuePosition:
        """Return the position of a job in the queue, with an estimate of the time until its end."""
        return QueuePosition.of(self._transport.get(f"{_path(job)}/queue"))

    def quality(self, job: Job | str) -> QualityCounts:
        """Return how many motions of a job have quality flags, and which."""
        return QualityCounts.of(self._transport.get(f"{_path(job)}/quality"))

    def items(
        self,
        job: Job | str,
        *,
        state: str | None = None,
        review: str | None = None,
        limit: int | None = None,
        page_size: int | None = None,
    ) -> Iterator[JobItem]:
        """Iterate over the items of a job in input order, each with its motion if it has one.

        Args:
            state: only items in this state.
            review: only items whose motion has this review.
            limit: the largest number of items; None = all.
            page_size: items of each request, at most 1,000; None = as many as the limit allows.
        """
        return self._pages(JobItem, f"{_path(job)}/items", limit, page_size, state=state, review=review)

    def pause(self, job: Job | str, *, reason: str | None = None) -> Job:
        """Stop starting items of a job; running items are finished.

        Args:
            reason: recorded in the job's events.
        """
        return self._act(job, "pause", reason=reason)

    def resume(self, job: Job | str, *, reason: str | None = None) -> Job:
        """Resume a paused job.

        Args:
            reason: recorded in the job's events.
        """
        return self._act(job, "resume", reason=reason)

    def cancel(self, job: Job | str, *, reason: str | None = None) -> Job:
        """Cancel unfinished items; finished ones stay.

        Args:
            reason: recorded in the job's events.
        """
        return self._act(job, "cancel", reason=reason)

    def retry(self, job: Job | str, *, failed_only: bool = False, reason: str | None = None) -> Job:
        """Retry failed, dead and cancelled items.

        Args:
            failed_only: leave cancelled items as they are.
            reason: recorded in the job's events.
        """
        return self._act(job, "retry", failed_only=failed_only or None, reason=reason)

    def update(self, job: Job | str, *, reason: str | None = None, **changes: Unpack[JobChanges]) -> Job:
        """Change a job.

        Args:
            reason: recorded in the job's events.
            changes: priority, comment (None removes it), fail_early (None = never).
        """
        return Job.of(self._transport.patch(_path(job), changes, reason=reason))

    def erase(self, job: Job | str) -> Erasure:
        """Erase the prompts of an ended job and of its edits permanently; motions, names and tags stay."""
        return Erasure.of(self._transport.post(f"{_path(job)}/erase"))

    def delete(self, job: Job | str) -> None:
        """Delete an ended job with its motions."""
        self._transport.delete(_path(job))

    def watch(self, job: Job | str, *, timeout: float | None = None) -> Iterator[Progress]:
        """Iterate over the progress of a job until it has ended; a connection that breaks is opened again.

        Args:
            timeout: seconds; None = no limit.

        Raises:
            TimedOut: `timeout` passed; the job continues.
            Unreachable: the server was away for three minutes.
        """
        for view, event in follow_job(self._transport, identifier(job), timeout=timeout, hint=WAIT_HINT):
            yield progress_of(view, event)

    def wait(
        self, job: Job | str, *, timeout: float | None = None, on_progress: OnProgress | None = None, check: bool = True
    ) -> Job:
        """Wait until a job has ended, and return it.

        Args:
            timeout: seconds; None = no limit.
            on_progress: called with each change.
            check: raise if items have no result.

        Raises:
            ItemsFailed: some failed, died or were cancelled.
            TimedOut, Unreachable: as `watch`.
        """
        ended: Mapping[str, Any] = {}
        for view, event in follow_job(self._transport, identifier(job), timeout=timeout, hint=WAIT_HINT):
            ended = view
            if on_progress is not None:
                on_progress(progress_of(view, event))
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
        """Iterate over the events of a job as they happen. Ends with the job, or with the connection; `watch` opens it
        again.

        Args:
            after: the `seq` of the last known event.
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
        review: ReviewName | Sequence[ReviewName] | None = None,
        prune: bool = False,
        overwrite: bool = False,
        bvh_root: BvhRoot = "zero",
        root_bone: bool = False,
        in_place: InPlace | None = None,
        tpose_frame: bool = False,
        rest_pose: RestPose = "t",
        placement: Placement = "origin",
        mesh: bool = False,
        rig: str | None = None,
        rig_map: str | None = None,
        names: Names | None = None,
        body: str | None = None,
        on_progress: OnFetched | FetchObserver | None = None,
    ) -> Sequence[FetchedItem]:
        """Fetch the motions that a job has so far, eight files at a time, with a `manifest.csv`.

        Complete files are not fetched again, partial ones are continued, and each is verified by its sha256.

        Args:
            folder: created if missing.
            formats: such as bvh and npz; None = all that the server has. Others that this process can write, and files
                with options of the export, are made of the npz (extra `motion`), at every fetch anew.
            name_template: of the paths, from `{index} {name} {prompt} {seed} {variant} {model} {bundle} {job} {tags}`.
            review: only motions with this review, or with one of several.
            prune: remove files of earlier fetches of the job that this fetch does not include.
            overwrite: replace files with other content.
            bvh_root, root_bone, in_place, tpose_frame, rest_pose, placement, mesh, rig_map, names: of files whose
                formats have these options; see `docs/reference/formats.md`.
            rig, body: a file, or the name of a rig of the server, which then makes the files; `body` gives the motions
                the proportions of it, see `docs/how-to/bodies.md`.
            on_progress: called with the numbers of fetched files and of all files, one call at a time, from any thread;
                or an observer with a method for each event.

        Returns:
            The items in input order, also those without a motion.

        Raises:
            Conflict: a file exists with other content, or a format was not made and cannot be made here; nothing is
                fetched then, unless it is the content of a made file.
            NotFound: the file of a body or a rig does not exist, or the server has no such rig.
            TimedOut: the server does not make a file within 10 minutes.
            InvalidFile: the data that arrived has another sha256, or cannot be written; or the body is no human one.
            InvalidInput: the folder cannot be written, two motions would have one name, an option is of no format, or
                two contradict each other.
            Unreachable: the connection breaks repeatedly; another fetch continues.
        """
        planned = fetch_job(
            self._transport,
            identifier(job),
            Path(folder),
            formats,
            template=check_template(name_template),
            review=review,
            prune=prune,
            overwrite=overwrite,
            export=ExportOptions(
                bvh_root=bvh_root,
                root_bone=root_bone,
                in_place=in_place,
                tpose_frame=tpose_frame,
                rest_pose=rest_pose,
                placement=placement,
                mesh=mesh,
                rig=rig,
                rig_map=rig_map,
                names=names,
                body=body,
            ),
            observer=FetchCounter(on_progress) if callable(on_progress) else on_progress,
        )
        return [
            FetchedItem(item=JobItem.of(item), files={file.format: file.path for file in files})
            for item, files in planned
        ]

    def _submit(self, reader: PromptReader, idempotency_key: str | None, **params: Any) -> SubmittedJob:
        return SubmittedJob.of(self._send(reader, idempotency_key=idempotency_key, **params))

    def _send(self, reader: PromptReader, **params: Any) -> Any:
        with Lines(item.as_json() for item in reader) as lines:
            if reader.total:
                raise reader.error()
            with reader.in_source():
                return self._transport.submit(lines, **params)

    def _act(self, job: Job | str, verb: str, **params: Any) -> Job:
        return Job.of(self._transport.post(f"{_path(job)}/{verb}", **params))


def _path(job: Job | str) -> str:
    return f"/v1/jobs/{identifier(job)}"
