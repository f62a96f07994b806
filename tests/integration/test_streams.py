"""Frame streams and control messages on a real Valkey."""

from __future__ import annotations

import itertools
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import redis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from marey.core.errors import Conflict, InvalidInput, Unreachable
from marey.embedded import start_valkey
from marey.runtime.queue import redis_client
from marey.streams.control import START, ControlQueue, StreamControl
from marey.streams.frames import Frame, decode_frame
from marey.streams.notifier import StreamNotifier
from marey.streams.redis import LEASE_MS, FrameStream, Gap, Lease, LeaseLost, StoredFrame

ACTS = ["write", "renew", "lapse", "release", "take"]
FOREIGN = [b"\xff\x00", b"[]", b'{"kind": "fly"}', b'{"kind": 3}', b'{"kind": "steer"}', b'{"kind": "stop", "x": 1}']
_names = itertools.count()
many_examples = settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def new_stream(client: redis.Redis, lease_ms: int = 60_000, **options: int) -> FrameStream:
    """Its lease outlives any stall of the machine; `lapse` ends it."""
    return FrameStream(client, f"s{next(_names)}", lease_ms=lease_ms, **options)


def lapse(client: redis.Redis, stream: FrameStream) -> None:
    """Expire the lease as Redis does."""
    client.delete(stream.lease_key)


def frames(first: int, count: int, prompt: int = 0) -> list[Frame]:
    turns = np.tile(np.float32([1, 0, 0, 0]), (22, 1))
    return [Frame(n, np.float32([n, 0.9, 0]), turns, prompt=prompt) for n in range(first, first + count)]


def taken(stream: FrameStream) -> Lease:
    lease = stream.acquire()
    assert lease is not None
    return lease


def numbers(found: list[StoredFrame | Gap]) -> list[int]:
    """Numbers of frames, each also what its bytes say."""
    stored = [each for each in found if isinstance(each, StoredFrame)]
    assert [decode_frame(each.data, joints=22).number for each in stored] == [each.number for each in stored]
    return [each.number for each in stored]


# -- the lease -----------------------------------------------------------------------------------------------------


def test_a_frame_is_written_under_its_number(client: redis.Redis) -> None:
    stream = new_stream(client)
    stream.write(taken(stream), frames(0, 3))
    ids = [identity for identity, _ in client.xrange(stream.frames_key)]
    assert ids == [b"1-0", b"2-0", b"3-0"]
    assert stream.bounds() == (0, 3)


@pytest.mark.parametrize("read", ["xrange", "xrevrange"])
def test_a_stream_that_goes_while_its_bounds_are_read_has_none(
    client: redis.Redis, monkeypatch: pytest.MonkeyPatch, read: str
) -> None:
    stream = new_stream(client)
    stream.write(taken(stream), frames(0, 3))
    asked = getattr(client, read)

    def gone(*args: object, **options: object) -> object:
        client.delete(stream.frames_key)
        return asked(*args, **options)

    monkeypatch.setattr(client, read, gone)
    assert stream.bounds() == (0, 0)


def test_an_old_holder_cannot_write_after_the_lease_moved(client: redis.Redis) -> None:
    stream = new_stream(client)
    old = taken(stream)
    stream.write(old, frames(0, 2))
    lapse(client, stream)
    new = taken(stream)
    assert (new.fence, new.next_frame) == (old.fence + 1, 2)
    for write in (frames(2, 1), frames(0, 2)):
        with pytest.raises(LeaseLost, match=f"lease {old.fence} has expired"):
            stream.write(old, write)
    with pytest.raises(LeaseLost):
        stream.renew(old)
    assert not stream.release(old)
    assert stream.bounds() == (0, 2)


def test_a_lease_that_ran_out_writes_nothing_though_nobody_took_it(client: redis.Redis) -> None:
    stream = new_stream(client, lease_ms=30)
    lease = taken(stream)
    time.sleep(0.06)
    with pytest.raises(LeaseLost):
        stream.write(lease, frames(0, 1))
    with pytest.raises(LeaseLost):
        stream.renew(lease)
    assert stream.bounds() == (0, 0)


def test_a_lease_lasts_a_second_and_a_half_and_as_long_as_it_is_renewed(client: redis.Redis) -> None:
    assert LEASE_MS == 1500
    stream = new_stream(client)
    lease = taken(stream)
    assert 30_000 < client.pttl(stream.lease_key) <= 60_000
    client.pexpire(stream.lease_key, 20_000)
    stream.renew(lease)
    assert 30_000 < client.pttl(stream.lease_key) <= 60_000
    assert stream.acquire() is None


def test_a_released_stream_is_free_at_once(client: redis.Redis) -> None:
    stream = new_stream(client)
    assert stream.release(taken(stream))
    assert taken(stream).fence == 2


def test_of_many_who_want_a_stream_one_gets_it(client: redis.Redis) -> None:
    stream = new_stream(client)
    got: list[Lease | None] = []
    threads = [threading.Thread(target=lambda: got.append(stream.acquire())) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sum(lease is not None for lease in got) == 1


def test_a_redis_that_forgot_everything_lets_no_old_holder_in(client: redis.Redis) -> None:
    stream = new_stream(client)
    old = taken(stream)
    stream.write(old, frames(0, 5))
    client.flushall()
    with pytest.raises(LeaseLost):
        stream.write(old, frames(5, 1))
    again = taken(stream)
    assert (again.fence, again.next_frame) == (old.fence, 0)  # it counts from the start again: the token tells
    with pytest.raises(LeaseLost):
        stream.write(old, frames(5, 1))
    stream.release(again)
    above = stream.acquire(above=41)
    assert above is not None
    assert above.fence == 42
    stream.write(above, frames(5, 1))  # the durable state knows where the stream was
    assert stream.bounds() == (5, 6)


@many_examples
@given(
    st.lists(st.tuples(st.integers(0, 2), st.sampled_from(["write", "renew", "lapse", "release", "take"])), max_size=60)
)
def test_whatever_workers_do_the_stream_is_whole_and_fences_only_go_up(
    client: redis.Redis, acts: list[tuple[int, str]]
) -> None:
    stream = new_stream(client)
    held: dict[int, Lease] = {}
    at: dict[int, int] = {}
    for worker, act in acts:
        if act == "lapse":
            lapse(client, stream)
        elif act == "take" and (lease := stream.acquire()):
            held[worker], at[worker] = lease, lease.next_frame
        elif worker in held and act == "release":
            stream.release(held[worker])
        elif worker in held:
            try:
                if act == "renew":
                    stream.renew(held[worker])
                elif act == "write":
                    stream.write(held[worker], frames(at[worker], 2, held[worker].fence))
                    at[worker] += 2
            except LeaseLost:
                del held[worker]
    found = stream.reader().read(count=1000)
    assert numbers(found) == list(range(len(found)))
    fences = [decode_frame(each.data).prompt for each in found if isinstance(each, StoredFrame)]
    assert fences == sorted(fences)


# -- writing -------------------------------------------------------------------------------------------------------


def test_frames_that_do_not_follow_are_refused_with_the_number_that_would(client: redis.Redis) -> None:
    stream = new_stream(client)
    lease = taken(stream)
    stream.write(lease, frames(0, 3))
    for first, count in ((4, 1), (2, 3), (1, 1)):
        with pytest.raises(Conflict, match=f"frame {first} does not follow; the next is 3"):
            stream.write(lease, frames(first, count, prompt=1))
    with pytest.raises(InvalidInput, match="go up by one"):
        stream.write(lease, [*frames(3, 1), *frames(5, 1)])
    assert stream.bounds() == (0, 3)


def test_a_write_that_is_sent_again_is_written_once(client: redis.Redis) -> None:
    stream = new_stream(client)
    lease = taken(stream)
    for _ in range(2):
        stream.write(lease, frames(0, 3))
    assert numbers(stream.reader().read()) == [0, 1, 2]
    with pytest.raises(Conflict, match="does not follow"):
        stream.write(lease, frames(1, 2, prompt=1))  # other frames of the same numbers


def test_a_write_whose_answer_was_lost_is_sent_again_with_the_frames_made_since(client: redis.Redis) -> None:
    stream = new_stream(client)
    lease = taken(stream)
    stream.write(lease, frames(0, 2))
    stream.write(lease, frames(2, 2))  # the writer does not hear of it
    stream.write(lease, frames(2, 5))
    assert numbers(stream.reader().read()) == list(range(7))


def test_no_frames_are_no_write(client: redis.Redis) -> None:
    stream = new_stream(client)
    stream.write(taken(stream), [])
    assert stream.bounds() == (0, 0)


def test_a_stream_is_gone_after_it_was_idle_and_when_it_is_dropped(client: redis.Redis) -> None:
    stream = new_stream(client, keep_ms=60_000)
    stream.write(taken(stream), frames(0, 1))
    assert 0 < client.pttl(stream.frames_key) <= 60_000
    client.pexpire(stream.frames_key, 50)
    other = new_stream(client)
    other.write(taken(other), frames(0, 1))
    ControlQueue(client, other.stream).send(StreamControl("stop"))
    assert 3_500_000 < client.pttl(other.frames_key) <= 3_600_000
    other.drop()
    time.sleep(0.08)
    assert client.keys(f"marey:stream:{{{stream.stream}}}:frames") == []
    assert client.keys(f"marey:stream:{{{other.stream}}}:*") == []


@pytest.mark.parametrize("name", ["", "a b", "a}b", "x" * 65, "ä"])
def test_an_id_that_is_none_is_refused(client: redis.Redis, name: str) -> None:
    with pytest.raises(InvalidInput, match="id of a stream"):
        FrameStream(client, name)


# -- reading -------------------------------------------------------------------------------------------------------


@many_examples
@given(
    st.lists(st.integers(1, 40), min_size=1, max_size=10),
    st.lists(st.tuples(st.integers(1, 30), st.booleans()), max_size=30),
)
def test_a_reader_that_comes_back_gets_every_frame_once(
    client: redis.Redis, writes: list[int], reads: list[tuple[int, bool]]
) -> None:
    stream = new_stream(client)
    lease, at = taken(stream), 0
    reader, found = stream.reader(), list[StoredFrame | Gap]()
    for write, (count, reconnects) in itertools.zip_longest(writes, reads, fillvalue=(500, True)):
        if isinstance(write, int):
            stream.write(lease, frames(at, write))
            at += write
        found += reader.read(count=count)
        if reconnects:
            reader = stream.reader(reader.at)
    found += reader.read(count=1000)
    assert numbers(found) == list(range(at))
    assert len(found) == at


def test_a_gap_is_told_with_its_size(client: redis.Redis) -> None:
    stream = new_stream(client)
    lease = taken(stream)
    for first in range(0, 1300, 100):
        stream.write(lease, frames(first, 100))
    assert client.xlen(stream.frames_key) == 1200
    assert stream.bounds() == (100, 1300)
    found = stream.reader().read(count=5)
    assert found[0] == Gap(0, 100)
    assert numbers(found) == [100, 101, 102, 103, 104]
    late = stream.reader(40)
    found = late.read(count=2000)
    assert found[0] == Gap(40, 60)
    assert numbers(found) == list(range(100, 1300))
    assert late.at == 1300
    assert numbers(stream.reader(100).read(count=1)) == [100]


def test_a_gap_in_the_middle_is_told_where_it_is(client: redis.Redis) -> None:
    stream = new_stream(client)
    stream.write(taken(stream), frames(0, 2))
    client.xadd(stream.frames_key, {"f": b"x"}, id="8-0")
    found = stream.reader().read()
    assert found[2:] == [Gap(2, 5), StoredFrame(7, b"x")]


def test_a_slow_client_skips_to_the_newest_frame_and_is_told_what_it_missed(client: redis.Redis) -> None:
    stream = new_stream(client)
    reader = stream.reader()
    assert reader.skip() is None
    stream.write(taken(stream), frames(0, 50))
    reader.read(count=10)
    assert reader.skip() == Gap(10, 39)
    assert reader.skip() is None
    assert numbers(reader.read()) == [49]
    assert reader.skip() is None
    assert reader.at == 50


def test_a_reader_waits_for_a_frame_that_comes(client: redis.Redis, queue_url: str) -> None:
    stream = new_stream(client)
    lease = taken(stream)

    def write_later() -> None:
        time.sleep(0.1)
        with redis_client(queue_url) as own:
            FrameStream(own, stream.stream).write(lease, frames(0, 1))

    writer = threading.Thread(target=write_later)
    writer.start()
    assert numbers(stream.reader().read(block_ms=60_000)) == [0]
    writer.join()


def test_a_reader_that_waits_in_vain_gets_nothing(client: redis.Redis) -> None:
    stream = new_stream(client)
    assert stream.reader(7).read() == []
    began = time.monotonic()
    assert stream.reader(7).read(block_ms=20) == []
    assert time.monotonic() - began >= 0.02


def test_a_reader_beside_the_writer_gets_every_frame_once(client: redis.Redis, queue_url: str) -> None:
    stream = new_stream(client)
    lease = taken(stream)
    found: list[StoredFrame | Gap] = []

    def read() -> None:
        with redis_client(queue_url) as own:
            reader = FrameStream(own, stream.stream).reader()
            while reader.at < 600:
                found.extend(reader.read(count=7, block_ms=2000))

    thread = threading.Thread(target=read)
    thread.start()
    for first in range(0, 600, 3):
        stream.renew(lease)
        stream.write(lease, frames(first, 3))
    thread.join(30)
    assert numbers(found) == list(range(600))
    assert len(found) == 600


@pytest.mark.parametrize("protocol", [2, 3])
def test_both_protocols_of_redis_are_read(queue_url: str, protocol: int) -> None:
    with redis_client(f"{queue_url}?protocol={protocol}") as client:
        stream, queue = new_stream(client), ControlQueue(client, "both")
        lease = taken(stream)
        assert stream.reader().read(block_ms=10) == []
        stream.write(lease, frames(0, 2))
        assert numbers(stream.reader().read()) == [0, 1]
        identity = queue.send(StreamControl("stop"))
        assert queue.read() == [(identity, StreamControl("stop"))]


def test_frames_before_the_first_are_refused(client: redis.Redis) -> None:
    with pytest.raises(InvalidInput, match="counted from 0"):
        new_stream(client).reader(-1)


# -- control -------------------------------------------------------------------------------------------------------


def test_messages_arrive_in_order_and_the_next_worker_reads_on(client: redis.Redis) -> None:
    queue = ControlQueue(client, "c1")
    sent = [
        StreamControl("pause"),
        StreamControl("resume"),
        StreamControl("steer", "a person jumps, später"),
        StreamControl("stop"),
        StreamControl("stop", pose={"joint_rotations": [[1.0, 0.0, 0.0, 0.0]], "root_height": 0.9}),
    ]
    ids = [queue.send(control) for control in sent]
    assert queue.read() == list(zip(ids, sent, strict=True))
    assert [control for _, control in ControlQueue(client, "c1").read(ids[1])] == sent[2:]
    assert queue.read(ids[-1]) == []
    assert queue.read(ids[-1], block_ms=20) == []


def test_a_message_of_another_release_is_told_and_stops_nothing(client: redis.Redis) -> None:
    queue = ControlQueue(client, "c2")
    for foreign in (
        b"\xff\x00",
        b"[]",
        b'{"kind": "fly"}',
        b'{"kind": 3}',
        b'{"kind": "steer"}',
        b'{"kind":"stop","x":1}',
        b'{"kind":"stop","pose":[]}',
        b'{"kind":"pause","pose":{}}',
    ):
        client.xadd(queue.key, {"m": foreign})
    client.xadd(queue.key, {"other": b"x"})
    queue.send(StreamControl("stop"))
    found = [message for _, message in queue.read(START)]
    assert len(found) == 10
    assert all(isinstance(message, InvalidInput) for message in found[:-1])
    assert found[-1] == StreamControl("stop")


@pytest.mark.parametrize(("kind", "prompt"), [("steer", None), ("steer", ""), ("pause", "a walk"), ("fly", None)])
def test_a_message_that_makes_no_sense_cannot_be_made(kind: str, prompt: str | None) -> None:
    with pytest.raises(InvalidInput):
        StreamControl(kind, prompt)  # type: ignore[arg-type]


# -- outages -------------------------------------------------------------------------------------------------------


def test_a_redis_that_is_gone_is_unreachable(short_home: Path) -> None:
    server = start_valkey(short_home)
    with redis_client(server.url) as client:
        stream, queue = FrameStream(client, "gone"), ControlQueue(client, "gone")
        lease = taken(stream)
        server.stop()
        for call in (
            stream.acquire,
            lambda: stream.renew(lease),
            lambda: stream.write(lease, frames(0, 1)),
            lambda: stream.release(lease),
            stream.bounds,
            stream.reader().read,
            stream.drop,
            queue.read,
            lambda: queue.send(StreamControl("stop")),
        ):
            with pytest.raises(Unreachable, match="Redis failed"):
                call()


def test_a_redis_that_is_full_is_unreachable_and_what_stands_can_be_read(short_home: Path) -> None:
    with start_valkey(short_home) as server, redis_client(server.url) as client:
        stream = FrameStream(client, "full")
        lease = taken(stream)
        stream.write(lease, frames(0, 1))
        client.config_set("maxmemory", "1")
        with pytest.raises(Unreachable, match="Redis failed"):
            stream.write(lease, frames(1, 1))
        assert numbers(stream.reader().read()) == [0]


def test_every_worker_hears_the_bell_once(client: redis.Redis) -> None:
    ours, theirs = StreamNotifier(client), StreamNotifier(client)
    ours.poll(), theirs.poll()
    assert (ours.poll(), theirs.poll()) == (False, False)
    StreamNotifier(client).notify()
    assert (ours.poll(), theirs.poll()) == (True, True)
    assert (ours.poll(), theirs.poll()) == (False, False)
    StreamNotifier(client).notify()
    StreamNotifier(client).notify()
    assert (ours.poll(), ours.poll()) == (True, False)


def test_a_notifier_without_redis_says_so(tmp_path: Path) -> None:
    server = start_valkey(tmp_path)
    with redis_client(server.url) as client:
        server.stop()
        for use in (StreamNotifier(client).notify, StreamNotifier(client).poll):
            with pytest.raises(Unreachable):
                use()
