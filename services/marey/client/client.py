"""The client of one server, with a resource for each noun of its API."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, Self

from marey.client.evaluations import Evaluations
from marey.client.jobs import Jobs
from marey.client.models import Models
from marey.client.motions import Motions
from marey.client.references import References
from marey.client.resources import identifier
from marey.client.rigs import Rigs
from marey.client.schedules import Schedules
from marey.client.server_address import Server, find_server, server_at
from marey.client.streams import Streams
from marey.client.transport import Transport
from marey.client.types.jobs import CheckedEdit, SubmittedJob
from marey.client.types.motions import Motion
from marey.client.webhooks import Webhooks
from marey.vocabulary.scope import ScopePolicy


class Client:
    """A client of a Marey server; safe to use from several threads, except for `LiveStream`.

    Failed requests that may be repeated are retried with back-off; a submit and all its retries share one idempotency
    key. Every expected failure is a `MareyError`.

    Args:
        server: its URL; None = that of `MAREY_SERVER`, or of a `marey serve` on this machine.
        key: an API key; None = that of `MAREY_KEY` or `MAREY_KEY_FILE`, or of the `marey serve`.
        timeout: seconds without data from the server after which a request counts as failed.
        attempts: the largest number of attempts of each request; None = 5, and longer while the server is busy.

    Raises:
        Unreachable: no server is given and none runs here.
        Unauthenticated: there is no key.
        InvalidInput: the URL is not one.

    Attributes:
        jobs, motions, streams, evaluations, schedules, webhooks, models, references, rigs: the nouns of the API.
    """

    def __init__(
        self,
        server: str | Server | None = None,
        key: str | None = None,
        *,
        timeout: float = 30.0,
        attempts: int | None = None,
    ) -> None:
        if not isinstance(server, Server):
            server = find_server() if server is None else server_at(server, key)
        if key is not None and key != server.key:
            server = Server(server.url, key)
        self._transport = Transport(server, timeout=timeout, attempts=attempts)
        self.jobs = Jobs(self._transport)
        self.motions = Motions(self._transport)
        self.streams = Streams(self._transport)
        self.evaluations = Evaluations(self._transport)
        self.schedules = Schedules(self._transport)
        self.webhooks = Webhooks(self._transport)
        self.models = Models(self._transport)
        self.references = References(self._transport)
        self.rigs = Rigs(self._transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def edit(
        self,
        motion: Motion | str,
        ops: Sequence[Mapping[str, Any]],
        *,
        model: str | None = None,
        settings: Mapping[str, float] | None = None,
        name: str | None = None,
        comment: str | None = None,
        priority: int = 0,
        keep_days: int | None = None,
        scope: ScopePolicy = "warn",
        idempotency_key: str | None = None,
    ) -> SubmittedJob:
        """Edit a stored motion on the server; `jobs.wait` waits, and `motions.list(job=…)` has the results.

        Args:
            motion: to edit; it does not change.
            ops: operations such as `[{"op": "trim", "from": 0.5}, {"op": "loop"}]`, applied in their order; `with` is
                another stored motion or its id. Each `split` makes two motions of one.
            model: model, bundle or exact bundle that generates frames, for operations that need one; None = the
                server's default.
            settings: of sampling, for the model.
            name, comment: of the job.
            priority: -1000 to 1000; higher runs first.
            keep_days: delete the job with its motions this many days after its end; None = the server's default.
            scope: prompts with actions that the model does not know: `warn`, `refuse` or `ignore`.
            idempotency_key: of all attempts; None = random.

        Raises:
            NotFound: there is no such motion.
            InvalidInput: an operation that is unknown, or a value that it does not allow.
            TooLarge: too many pieces, or motions that are too long.
            QuotaUsedUp, Conflict, Refused, Unreachable: as the server says.
        """
        given = {
            "model": model,
            "settings": settings,
            "name": name,
            "comment": comment,
            "priority": priority or None,
            "keep_days": keep_days,
            "scope": None if scope == "warn" else scope,
        }
        path, body = _edit_request(motion, ops, given)
        return SubmittedJob.of(self._transport.post_new(path, body, idempotency_key=idempotency_key))

    def check_edit(
        self,
        motion: Motion | str,
        ops: Sequence[Mapping[str, Any]],
        *,
        model: str | None = None,
        settings: Mapping[str, float] | None = None,
        scope: ScopePolicy = "warn",
    ) -> CheckedEdit:
        """Check what `edit` would submit, and submit nothing; the result has the number of motions and an estimate.

        Args:
            motion, ops, model, settings, scope: see `edit`.

        Raises:
            NotFound, InvalidInput, TooLarge, QuotaUsedUp, Conflict, Refused, Unreachable: as `edit`.
        """
        given = {"model": model, "settings": settings, "scope": None if scope == "warn" else scope}
        path, body = _edit_request(motion, ops, given)
        return CheckedEdit.of(self._transport.post(path, body, validate_only=True))

    @property
    def server(self) -> Server:
        """The server and the key that this client uses."""
        return self._transport.server

    def close(self) -> None:
        """Close the connections."""
        self._transport.close()


def _edit_request(
    motion: Motion | str, ops: Sequence[Mapping[str, Any]], given: Mapping[str, object]
) -> tuple[str, dict[str, Any]]:
    """Return path and body of an edit."""
    body = {"ops": [_named(op) for op in ops], **{key: each for key, each in given.items() if each is not None}}
    return f"/v1/motions/{identifier(motion)}/edits", body


def _named(op: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return an operation with the ids of motions."""
    return {name: identifier(value) if isinstance(value, Motion) else value for name, value in op.items()}
