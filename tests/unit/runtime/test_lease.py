import threading
import time
from collections.abc import Collection
from uuid import UUID, uuid4

import pytest

from marey.core.errors import Unreachable
from marey.jobs import Claim, ClaimedItem, HeartbeatReply, ItemStage
from marey.runtime.lease import Heartbeat, HeldLease


def make_claim(count: int) -> Claim:
    items = tuple(
        ClaimedItem(
            id=uuid4(), position=n, index=n, variant=0, name=None, prompt="walk", model="toy", bundle="toy@0",
            text_key="k", seed=n, seconds=None, settings={}, tags=(), attempts=0,
        )
        for n in range(count)
    )  # fmt: skip
    return Claim(uuid4(), "default", uuid4(), "toy", ItemStage.GENERATE, "b", "toy@0", solo=False, items=items)


class Database:
    """The heartbeat's statements, and their answers."""

    def __init__(self) -> None:
        self.asked: list[tuple[set[UUID], bool]] = []
        self.answer = HeartbeatReply(lost=False, gone=frozenset())
        self.away = False
        self.asked_at: list[float] = []

    def renew(self, _token: UUID, items: Collection[UUID], progressed: bool) -> HeartbeatReply:
        self.asked.append((set(items), progressed))
        self.asked_at.append(time.monotonic())
        if self.away:
            raise Unreachable("gone")
        return self.answer


@pytest.fixture
def database() -> Database:
    return Database()


@pytest.fixture
def heartbeat(database: Database) -> Heartbeat:
    return Heartbeat(database.renew, interval=60.0, stopping=threading.Event())


def test_a_cancelled_item_is_dropped_and_its_neighbours_are_not(database: Database, heartbeat: Heartbeat) -> None:
    lease = heartbeat.hold(make_claim(3))
    cancelled = lease.claim.items[1].id
    database.answer = HeartbeatReply(lost=False, gone=frozenset({cancelled}))
    heartbeat.beat()
    assert lease.dropped() == {cancelled}
    assert lease.open == {lease.claim.items[0].id, lease.claim.items[2].id}


def test_a_lost_lease_drops_everything(database: Database, heartbeat: Heartbeat) -> None:
    lease = heartbeat.hold(make_claim(3))
    database.answer = HeartbeatReply(lost=True, gone=frozenset())
    heartbeat.beat()
    assert lease.dropped() == lease.lost == {item.id for item in lease.claim.items}
    assert not lease.open


def test_written_items_are_asked_about_no_more(database: Database, heartbeat: Heartbeat) -> None:
    lease = heartbeat.hold(make_claim(2))
    lease.settle([lease.claim.items[0].id])
    heartbeat.beat()
    assert database.asked == [({lease.claim.items[1].id}, True)]
    lease.settle([lease.claim.items[1].id])
    heartbeat.beat()
    assert len(database.asked) == 1


def test_a_silent_batch_says_so_until_it_moves_again(database: Database, heartbeat: Heartbeat) -> None:
    lease = heartbeat.hold(make_claim(1))
    heartbeat.beat()
    heartbeat.beat()
    lease.progress(1, 2)
    heartbeat.beat()
    assert [progressed for _, progressed in database.asked] == [True, False, True]


def test_loading_is_exempt_from_progress_until_the_first_step(database: Database, heartbeat: Heartbeat) -> None:
    lease = heartbeat.hold(make_claim(1))
    lease.exempt()
    for _ in range(3):
        heartbeat.beat()
    lease.progress(1, 2)
    heartbeat.beat()
    heartbeat.beat()
    assert [progressed for _, progressed in database.asked] == [True, True, True, True, False]


def test_an_outage_of_the_database_gives_nothing_up(database: Database, heartbeat: Heartbeat) -> None:
    lease = heartbeat.hold(make_claim(1))
    database.away = True
    heartbeat.beat()
    assert not lease.dropped()
    database.away = False
    heartbeat.beat()
    assert len(database.asked) == 2


def test_after_a_failed_renewal_the_next_comes_soon(database: Database) -> None:
    """Not a whole interval later: a lease must outlast a connection that fell silent."""
    heart = Heartbeat(database.renew, interval=1.5, stopping=threading.Event())
    heart.hold(make_claim(1))
    database.away = True
    times: list[float] = []
    database.asked_at = times
    heart.start()
    while len(times) < 3:
        time.sleep(0.02)
    heart.close()
    heart.join(30)
    assert times[2] - times[1] < 1.4


def test_a_lease_let_go_is_not_renewed(database: Database, heartbeat: Heartbeat) -> None:
    lease = heartbeat.hold(make_claim(1))
    heartbeat.let_go(lease)
    heartbeat.beat()
    assert database.asked == []


def test_a_worker_told_to_stop_wants_no_more_results() -> None:
    stopping = threading.Event()
    lease = HeldLease(make_claim(2), stopping)
    assert not lease.dropped()
    stopping.set()
    assert len(lease.dropped()) == 2
    assert not lease.lost  # what is finished is still written


def test_what_is_taken_away_between_two_heartbeats_is_dropped_without_a_renewal(database: Database) -> None:
    """The heart beats in a minute; the look in between comes within a hundredth of a second."""
    claim, looked = make_claim(2), threading.Event()
    kept = claim.items[0].id

    def held_by(token: UUID) -> frozenset[UUID]:
        assert token == claim.lease_token
        looked.set()
        return frozenset({kept})

    heart = Heartbeat(database.renew, interval=60.0, stopping=threading.Event(), held_by=held_by, look_seconds=0.01)
    lease = heart.hold(claim)
    heart.start()
    assert looked.wait(30)
    heart.close()
    heart.join(30)
    assert lease.dropped() == {claim.items[1].id}
    assert database.asked == []


def test_an_outage_between_two_heartbeats_takes_nothing_away(database: Database) -> None:
    def away(_token: UUID) -> frozenset[UUID]:
        raise Unreachable("gone")

    heart = Heartbeat(database.renew, interval=60.0, stopping=threading.Event(), held_by=away)
    lease = heart.hold(make_claim(2))
    heart.look()
    assert lease.dropped() == frozenset()
    assert len(lease.open) == 2


def test_a_batch_that_hangs_on_after_its_lease_was_lost_ends_its_child(database: Database) -> None:
    stuck: list[bool] = []
    heartbeat = Heartbeat(
        database.renew,
        interval=0.01,
        stopping=threading.Event(),
        stall_seconds=0.05,
        stuck=lambda: stuck.append(True) or heartbeat.close(),
    )
    heartbeat.hold(make_claim(2))
    database.answer = HeartbeatReply(lost=True, gone=frozenset())
    heartbeat.start()
    heartbeat.join(30.0)
    assert stuck == [True]


def test_only_a_silent_batch_of_which_nothing_is_ours_counts_as_stuck(database: Database) -> None:
    heartbeat = Heartbeat(database.renew, interval=60.0, stopping=threading.Event())
    lease = heartbeat.hold(make_claim(2))
    assert not lease.stuck(0.0)  # silent, but ours
    lease.learn(HeartbeatReply(lost=False, gone=frozenset({lease.claim.items[0].id})))
    assert not lease.stuck(0.0)  # half of it is
    lease.learn(HeartbeatReply(lost=True, gone=frozenset()))
    assert lease.stuck(0.0)
    assert not lease.stuck(3600.0)
    lease.exempt()
    assert not lease.stuck(0.0)  # loading is silent for minutes


def test_a_batch_that_waits_behind_a_slow_store_is_neither_silent_nor_stuck(
    database: Database, heartbeat: Heartbeat
) -> None:
    lease = heartbeat.hold(make_claim(1))
    lease.hand_over()
    heartbeat.beat()
    heartbeat.beat()
    lease.take_up()
    heartbeat.beat()
    heartbeat.beat()
    assert [progressed for _, progressed in database.asked] == [True, True, True, False]
    lease.learn(HeartbeatReply(lost=True, gone=frozenset()))
    assert lease.stuck(0.0)


def test_what_was_taken_away_while_it_waited_ends_no_child(heartbeat: Heartbeat) -> None:
    lease = heartbeat.hold(make_claim(1))
    lease.hand_over()
    lease.learn(HeartbeatReply(lost=True, gone=frozenset()))
    assert not lease.stuck(0.0)
