"""The states of a live stream: the database allows exactly the transitions of the code."""

from __future__ import annotations

from uuid import UUID

import pytest
import redis
import sqlalchemy as sa

from marey.streams.states import STREAM_TRANSITIONS, StreamState
from tests.support.live_loop import Studio


@pytest.mark.parametrize("before", StreamState)
@pytest.mark.parametrize("after", StreamState)
def test_the_database_allows_the_transitions_of_the_code(
    engine: sa.Engine, client: redis.Redis, before: StreamState, after: StreamState
) -> None:
    stream = Studio(engine, client, "model", "bundle@1").begin()
    ways = {
        StreamState.WAITING: [],
        StreamState.LIVE: [StreamState.LIVE],
        StreamState.PAUSED: [StreamState.LIVE, StreamState.PAUSED],
        StreamState.ENDED: [StreamState.ENDED],
        StreamState.FAILED: [StreamState.FAILED],
    }
    for state in ways[before]:
        move(engine, stream, state)
    if before is after or after in STREAM_TRANSITIONS[before]:
        move(engine, stream, after)
    else:
        with pytest.raises(sa.exc.DBAPIError, match="a stream may not go"):
            move(engine, stream, after)


def move(engine: sa.Engine, stream: UUID, state: StreamState) -> None:
    ended = "coalesce(ended_at, now())" if state in (StreamState.ENDED, StreamState.FAILED) else "NULL"
    with engine.begin() as conn:
        query = sa.text(f"UPDATE stream SET state = :state, ended_at = {ended} WHERE id = :id")
        conn.execute(query, {"state": state, "id": stream})
