"""Schedules: evaluations that are run again and again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypedDict, Unpack

from marey.client.evaluation_requests import EvaluationOptions, naming_lines, request_body
from marey.client.resources import Resource, identifier
from marey.client.types.evaluations import Evaluation, EvaluationDetail
from marey.client.types.schedules import Schedule


class ScheduleChanges(TypedDict, total=False):
    """Changes of a schedule; fields that are not given stay as they are."""

    name: str
    cron: str
    time_zone: str
    paused: bool


class Schedules(Resource):
    """`client.schedules`. Errors of all methods: NotFound, InvalidInput, Refused, Unreachable."""

    def create(
        self,
        cron: str,
        bundle: str,
        *,
        time_zone: str = "UTC",
        name: str | None = None,
        **options: Unpack[EvaluationOptions],
    ) -> Schedule:
        """Run an evaluation at the times of a cron expression. Each run looks up the bundles by the names given here.

        Args:
            cron: minute, hour, day of the month, month, day of the week: `0 3 * * 1` is every Monday at 03:00.
            bundle: model, bundle or exact bundle that generates.
            time_zone: a name of the tz database, such as `Europe/Berlin`.
            name: of the schedule and its runs.
            options: as those of `client.evaluations.run`.

        Raises:
            InvalidItems: with every problem of every prompt.
            InvalidInput: the expression, the time zone or an option cannot be used.
        """
        request = request_body(bundle, options)
        body = {**request.body, "cron": cron, "time_zone": time_zone, **({"name": name} if name else {})}
        with naming_lines(request):
            return Schedule.of(self._transport.post_once("/v1/schedules", body))

    def list(self, *, limit: int | None = None) -> Iterator[Schedule]:
        """Iterate over the schedules, newest first.

        Args:
            limit: the largest number of schedules; None = all.
        """
        return self._pages(Schedule, "/v1/schedules", limit)

    def get(self, schedule: Schedule | str) -> Schedule:
        """Return the current state of a schedule."""
        return Schedule.of(self._transport.get(_path(schedule)))

    def update(self, schedule: Schedule | str, **changes: Unpack[ScheduleChanges]) -> Schedule:
        """Change a schedule. With new times it is next due at the first of them from now on.

        Args:
            changes: name, cron, time_zone, paused.
        """
        return Schedule.of(self._transport.patch(_path(schedule), changes))

    def pause(self, schedule: Schedule | str) -> Schedule:
        """Pause a schedule; current runs continue."""
        return self.update(schedule, paused=True)

    def resume(self, schedule: Schedule | str) -> Schedule:
        """Resume a schedule from its next time on; missed runs are skipped."""
        return self.update(schedule, paused=False)

    def run(self, schedule: Schedule | str) -> EvaluationDetail:
        """Run a schedule's evaluation now, in addition to its times; also while it is paused."""
        return EvaluationDetail.of(self._transport.post_once(f"{_path(schedule)}/run", None))

    def runs(
        self, schedule: Schedule | str, *, limit: int | None = None, page_size: int | None = None
    ) -> Iterator[Evaluation]:
        """Iterate over the evaluations of a schedule, newest first.

        Args:
            limit: the largest number of evaluations; None = all.
            page_size: evaluations of each request, at most 1,000; None = as many as the limit allows.
        """
        return self._pages(Evaluation, f"{_path(schedule)}/evaluations", limit, page_size)

    def delete(self, schedule: Schedule | str) -> None:
        """Delete a schedule; its evaluations stay."""
        self._transport.delete(_path(schedule))


def _path(schedule: Schedule | str) -> str:
    return f"/v1/schedules/{identifier(schedule)}"
