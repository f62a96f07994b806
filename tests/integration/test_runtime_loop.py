"""The claim loop against real Postgres and a real folder store."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.core.errors import Unreachable
from marey.db import transaction
from marey.jobs import Policy, cancel, sweep
from marey.jobs.tables import item, motion
from marey.runtime import committer as committer_module
from marey.runtime import loop as loop_module
from marey.runtime.handler import Batch, BatchControl, Outcome
from marey.storage import FolderStore, NewObject
from marey.takes import collect_garbage
from marey.tenants.types import DEFAULT_TENANT
from tests.support.runtime import Loop
from tests.support.toy import FITS, ToyHandler
from tests.support.toy_jobs import TEXT_KEY, audit, ended, job_row, states, submit_toys


@pytest.fixture
def toy() -> ToyHandler:
    return ToyHandler()


@pytest.fixture
def make_loop(engine: sa.Engine) -> Iterator[Callable[..., Loop]]:
    loops: list[Loop] = []

    def make(store: FolderStore, *handlers: ToyHandler, interval: float = 0.1, rules: Policy | None = None) -> Loop:
        loops.append(Loop(engine, store, *handlers, interval=interval, rules=rules))
        return loops[-1]

    yield make
    for loop in loops:
        loop.close()


@pytest.fixture
def loop(make_loop: Callable[..., Loop], folder_store: FolderStore, toy: ToyHandler) -> Loop:
    return make_loop(folder_store, toy)


def wait(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "not in time"
        time.sleep(0.01)


def test_every_item_ends_with_one_motion_and_its_files(
    engine: sa.Engine, loop: Loop, folder_store: FolderStore, toy: ToyHandler
) -> None:
    job = submit_toys(engine, ["walk"] * 70)
    assert loop.run() == 70
    assert job_row(engine, job).succeeded == 70
    assert toy.batches == [32, 32, 6]
    assert len(list(folder_store.keys())) == 140
    assert audit(engine, folder_store) == []


def test_a_bundle_is_loaded_once_for_many_batches(engine: sa.Engine, loop: Loop, toy: ToyHandler) -> None:
    submit_toys(engine, ["walk"] * 40)
    submit_toys(engine, ["walk"] * 40)
    loop.run()
    assert toy.loaded == ["toy@0123456789ab"]


def test_queues_are_served_in_turns(
    engine: sa.Engine, make_loop: Callable[..., Loop], folder_store: FolderStore
) -> None:
    """A long job of one queue holds up no other queue of the same child."""
    served: list[str] = []

    class Named(ToyHandler):
        def __init__(self, queue: str) -> None:
            super().__init__()
            self.queue = queue

        def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
            served.append(self.queue)
            return super().run(batch, control)

    submit_toys(engine, ["walk"] * 128, queue="one")
    submit_toys(engine, ["walk"] * 64, queue="two")
    make_loop(folder_store, Named("one"), Named("two")).run()
    assert served == ["one", "two", "one", "two", "one", "one"]


def test_a_permanent_error_fails_its_item_alone(engine: sa.Engine, loop: Loop, folder_store: FolderStore) -> None:
    job = submit_toys(engine, ["walk", "refuse", "walk"])
    loop.run()
    assert states(engine, job) == {"succeeded": ["walk", "walk"], "failed": ["refuse"]}
    with transaction(engine) as conn:
        problem = conn.execute(sa.select(item.c.problem).where(item.c.prompt == "refuse")).scalar_one()
    assert problem["message"] == "this cannot be danced"
    assert audit(engine, folder_store) == []


def test_a_retryable_error_comes_back_later_and_counts(engine: sa.Engine, loop: Loop) -> None:
    job = submit_toys(engine, ["once", "walk"])
    loop.run()
    with transaction(engine) as conn:
        row = conn.execute(sa.select(item).where(item.c.prompt == "once")).one()
        assert (row.state, row.attempts) == ("ready", 1)
        assert row.run_after is not None
        conn.execute(sa.update(item).where(item.c.id == row.id).values(run_after=sa.func.now()))
    sweep(engine)
    loop.run()
    assert states(engine, job) == {"succeeded": ["once", "walk"]}


def test_a_bug_of_one_item_costs_its_neighbours_nothing(engine: sa.Engine, loop: Loop) -> None:
    job = submit_toys(engine, ["walk"] * 9 + ["bug"] + ["walk"] * 6)
    loop.run()
    assert job_row(engine, job).succeeded == 15
    with transaction(engine) as conn:
        row = conn.execute(sa.select(item).where(item.c.prompt == "bug")).one()
    assert (row.state, row.attempts) == ("ready", 1)
    assert "RuntimeError" in row.problem["message"]


def test_a_bug_that_stays_ends_dead(engine: sa.Engine, loop: Loop, folder_store: FolderStore) -> None:
    job = submit_toys(engine, ["bug", "walk"])
    for _ in range(Policy().max_attempts):
        loop.run()
        with transaction(engine) as conn:
            conn.execute(sa.update(item).where(item.c.run_after.is_not(None)).values(run_after=sa.func.now()))
        sweep(engine)
    assert states(engine, job) == {"dead": ["bug"], "succeeded": ["walk"]}
    assert audit(engine, folder_store) == []


def test_an_item_without_an_outcome_is_retried(engine: sa.Engine, loop: Loop) -> None:
    job = submit_toys(engine, ["silent", "walk"])
    loop.run()
    assert states(engine, job) == {"ready": ["silent"], "succeeded": ["walk"]}


def test_a_bug_in_the_export_fails_its_item_alone(engine: sa.Engine, loop: Loop) -> None:
    job = submit_toys(engine, ["walk", "bad-export", "walk"])
    loop.run()
    assert states(engine, job) == {"succeeded": ["walk", "walk"], "ready": ["bad-export"]}


def test_a_permanent_error_in_the_export_fails_its_item_alone(engine: sa.Engine, loop: Loop) -> None:
    job = submit_toys(engine, ["walk", "refused-export", "walk"])
    loop.run()
    assert states(engine, job) == {"succeeded": ["walk", "walk"], "failed": ["refused-export"]}


def test_out_of_memory_halves_the_batch_in_place(engine: sa.Engine, loop: Loop, toy: ToyHandler) -> None:
    job = submit_toys(engine, ["memory"] * 16)
    loop.run()
    assert job_row(engine, job).succeeded == 16
    assert toy.batches == [16, 8, FITS, FITS, 8, FITS, FITS]
    with transaction(engine) as conn:
        assert set(conn.execute(sa.select(item.c.attempts)).scalars()) == {0}


def test_a_lost_accelerator_ends_the_child_as_a_crash_would(
    engine: sa.Engine, make_loop: Callable[..., Loop], folder_store: FolderStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Halving would fail every item in turn, and so would every later batch of the process."""
    torch = pytest.importorskip("torch")

    class Crash(BaseException):
        pass

    def crash() -> None:
        raise Crash

    class Broken(ToyHandler):
        def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
            raise torch.AcceleratorError("CUDA error: device-side assert triggered", 710)
            yield

    monkeypatch.setattr(loop_module, "end_child", crash)
    submit_toys(engine, ["walk"] * 8)
    with pytest.raises(Crash):
        make_loop(folder_store, Broken()).run()


def test_a_bundle_that_is_not_here_fails_the_items_with_its_message(engine: sa.Engine, loop: Loop) -> None:
    job = submit_toys(engine, ["walk", "walk"], bundle="missing@0")
    loop.run()
    assert states(engine, job) == {"failed": ["walk", "walk"]}


def test_missing_text_features_are_retried(engine: sa.Engine, loop: Loop) -> None:
    job = submit_toys(engine, ["walk"])
    with transaction(engine) as conn:
        conn.execute(sa.text("DELETE FROM text_features WHERE key = :key"), {"key": TEXT_KEY})
    loop.run()
    assert states(engine, job) == {"ready": ["walk"]}


def test_an_outage_of_what_a_handler_needs_does_not_count(
    engine: sa.Engine, loop: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop_module, "OUTAGE_PAUSE", 0.01)
    job = submit_toys(engine, ["away", "walk"])
    loop.run(0.5)
    with transaction(engine) as conn:
        rows = conn.execute(sa.select(item)).all()
    assert {row.state for row in rows} == {"ready"}
    assert {row.attempts for row in rows} == {0}
    assert not ended(engine, job)


def test_cancelled_items_are_dropped_between_steps(
    engine: sa.Engine, loop: Loop, folder_store: FolderStore, toy: ToyHandler
) -> None:
    job = submit_toys(engine, ["walk"] * 8, steps=10_000, step_seconds=0.005)
    thread = threading.Thread(target=loop.run)
    thread.start()
    wait(lambda: job_row(engine, job).leased == 8)
    with transaction(engine) as conn:
        cancel(conn, DEFAULT_TENANT, job)
    thread.join(20.0)  # 10,000 steps would take 50 s
    assert not thread.is_alive()
    assert states(engine, job) == {"cancelled": ["walk"] * 8}
    assert audit(engine, folder_store) == []


def test_a_stop_releases_what_is_not_done_and_counts_nothing(
    engine: sa.Engine, loop: Loop, folder_store: FolderStore
) -> None:
    job = submit_toys(engine, ["walk"] * 8, steps=10_000, step_seconds=0.005)
    thread = threading.Thread(target=loop.run)
    thread.start()
    wait(lambda: job_row(engine, job).leased == 8)
    loop.stopping.set()
    thread.join(20.0)
    assert not thread.is_alive()
    with transaction(engine) as conn:
        rows = conn.execute(sa.select(item)).all()
    assert {(row.state, row.attempts, row.solo) for row in rows} == {("ready", 0, False)}


DRAIN_SECONDS = 0.5


class LeasedBatch(ToyHandler):
    """Hangs, without progress or a look around, until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.go_on = threading.Event()

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        assert self.go_on.wait(60.0)
        yield from super().run(batch, control)


def test_results_of_a_lost_lease_are_thrown_away(
    engine: sa.Engine, make_loop: Callable[..., Loop], folder_store: FolderStore
) -> None:
    """A worker that slept through its lease (a suspended laptop) must not write over who took over."""
    toy = LeasedBatch()
    sleeper = make_loop(folder_store, toy, interval=3600.0)
    job = submit_toys(engine, ["walk"] * 3)
    thread = threading.Thread(target=sleeper.run, args=(DRAIN_SECONDS,))
    thread.start()
    wait(lambda: job_row(engine, job).leased == 3)
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE lease SET expires_at = now() - interval '1 second'"))
    sweep(engine)
    assert job_row(engine, job).ready == 3
    time.sleep(DRAIN_SECONDS)  # it must not claim them again
    toy.go_on.set()
    thread.join(20.0)
    assert job_row(engine, job).succeeded == 0
    make_loop(folder_store, ToyHandler()).run()
    assert job_row(engine, job).succeeded == 3
    with transaction(engine) as conn:
        assert conn.execute(sa.select(sa.func.count()).select_from(motion)).scalar_one() == 3
    collect_garbage(engine, folder_store)
    assert audit(engine, folder_store) == []


def test_a_hung_decode_loop_loses_its_lease(
    engine: sa.Engine, make_loop: Callable[..., Loop], folder_store: FolderStore
) -> None:
    toy = LeasedBatch()
    loop = make_loop(folder_store, toy, rules=Policy(lease=0.4, stall=0.4))
    toy.go_on.set()
    submit_toys(engine, ["walk"])
    loop.run()  # the first batch after loading may be silent for long: it compiles
    toy.go_on.clear()
    job = submit_toys(engine, ["walk"] * 3)
    thread = threading.Thread(target=loop.run, args=(DRAIN_SECONDS,))
    thread.start()
    wait(lambda: job_row(engine, job).leased == 3)
    wait(lambda: sweep(engine).leases_lost == 1)
    assert job_row(engine, job).ready == 3
    time.sleep(DRAIN_SECONDS)  # it must not claim them again
    toy.go_on.set()
    thread.join(20.0)
    assert job_row(engine, job).succeeded == 0


def test_loading_a_bundle_may_take_longer_than_a_stall(
    engine: sa.Engine, make_loop: Callable[..., Loop], folder_store: FolderStore
) -> None:
    class SlowToLoad(ToyHandler):
        def load(self, bundle: str) -> None:
            time.sleep(4.0)

    job = submit_toys(engine, ["walk"] * 3)
    loop = make_loop(folder_store, SlowToLoad(), rules=Policy(lease=2.0, stall=0.4))
    thread = threading.Thread(target=loop.run)
    thread.start()
    wait(lambda: job_row(engine, job).leased == 3)
    lost = 0
    while thread.is_alive():
        lost += sweep(engine).leases_lost
        time.sleep(0.1)
    assert lost == 0
    assert job_row(engine, job).succeeded == 3


class Flaky(FolderStore):
    """A store that is away for the first `failures` batches of PUTs, each time after `before` objects."""

    def __init__(self, root: Path, failures: int, before: int = 0) -> None:
        super().__init__(root)
        self.failures = failures
        self.before = before
        self.tries = 0
        self.stored: list[str] = []

    def put_all(self, objects: Sequence[NewObject]) -> Iterator[str]:
        self.tries += 1
        away = self.tries <= self.failures
        for key in super().put_all(objects[: self.before] if away else objects):
            self.stored.append(key)
            yield key
        if away:
            raise Unreachable("the store is away")


def test_a_short_outage_of_the_store_is_ridden_out(
    engine: sa.Engine, make_loop: Callable[..., Loop], tmp_path: Path
) -> None:
    store = Flaky(tmp_path / "flaky", failures=2)
    job = submit_toys(engine, ["walk"] * 6)
    make_loop(store, ToyHandler()).run()
    assert job_row(engine, job).succeeded == 6
    assert audit(engine, store) == []


def test_what_was_stored_before_an_outage_is_not_stored_again(
    engine: sa.Engine, make_loop: Callable[..., Loop], tmp_path: Path
) -> None:
    store = Flaky(tmp_path / "flaky", failures=2, before=5)
    job = submit_toys(engine, ["walk"] * 8)
    make_loop(store, ToyHandler()).run()
    assert job_row(engine, job).succeeded == 8
    assert sorted(store.stored) == list(store.keys())
    assert audit(engine, store) == []


def test_a_long_outage_of_the_store_gives_the_items_back_uncounted(
    engine: sa.Engine, make_loop: Callable[..., Loop], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(committer_module, "STORE_PATIENCE", 0.2)
    store = Flaky(tmp_path / "flaky", failures=10**9)
    submit_toys(engine, ["walk"] * 3)
    loop = make_loop(store, ToyHandler())
    loop.run(0.3)
    with transaction(engine) as conn:
        rows = conn.execute(sa.select(item)).all()
    assert {(row.state, row.attempts, row.solo) for row in rows} == {("ready", 0, False)}
    store.failures = 0
    loop.run()
    assert audit(engine, store) == []


def test_a_stop_does_not_wait_for_a_store_that_is_away(
    engine: sa.Engine, make_loop: Callable[..., Loop], tmp_path: Path
) -> None:
    store = Flaky(tmp_path / "flaky", failures=10**9)
    job = submit_toys(engine, ["walk"] * 3)
    loop = make_loop(store, ToyHandler())
    thread = threading.Thread(target=loop.run)
    thread.start()
    wait(lambda: store.tries > 1)
    loop.stopping.set()
    thread.join(15.0)  # the store's patience is a minute
    assert not thread.is_alive()
    assert job_row(engine, job).ready == 3


def test_a_drain_claims_nothing_after_its_time(engine: sa.Engine, loop: Loop) -> None:
    job = submit_toys(engine, ["walk"] * 96, step_seconds=0.3)
    assert loop.run(0.2) in (32, 64)
    assert 0 < job_row(engine, job).succeeded < 96


def test_claims_and_steps_tick(engine: sa.Engine, loop: Loop) -> None:
    loop.run()
    assert loop.ticks == 1  # an idle worker's hint shows that hints reach it
