"""References: objects by the end of an id, by name, or the newest one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from marey.client.resources import Resource, identifier
from marey.client.types.references import ReferenceMatch, Resolution
from marey.client.types.webhooks import Webhook

ReferenceKind = Literal["job", "motion", "stream", "evaluation", "schedule", "webhook", "delivery"]


class References(Resource):
    """`client.references`."""

    def resolve(
        self, kind: ReferenceKind, reference: str, *, webhook: Webhook | str | None = None
    ) -> Sequence[ReferenceMatch]:
        """Return the objects that a short reference may mean, newest first, at most 10.

        Args:
            kind: of the object.
            reference: an id, its last 8 or more digits, a name, or `last` for the newest; of a motion also `JOB:INDEX`
                or `JOB:INDEX.VARIANT`.
            webhook: whose delivery; needed for the kind `delivery`.

        Returns:
            No element: there is no such object. Several: the reference is ambiguous.

        Raises:
            NotFound: the reference names an item that has no motion; the error tells its state.
            InvalidInput: the reference is empty or too long.
            Refused, Unreachable: as the server says.
        """
        of = None if webhook is None else identifier(webhook)
        found = self._transport.get("/v1/resolve", kind=kind, reference=reference, webhook=of)
        return Resolution.of(found).matches
