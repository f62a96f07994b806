"""Random walks through everything that can happen to jobs; after each step the tables must hold together."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from uuid import UUID

import pytest
import sqlalchemy as sa
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    Bundle,
    RuleBasedStateMachine,
    consumes,
    invariant,
    multiple,
    rule,
    run_state_machine_as_test,
)

from marey.core.errors import Conflict, NotFound, QuotaUsedUp
from marey.db import transaction
from marey.jobs import (
    Claim,
    Committed,
    ItemFailure,
    NewText,
    begin_assets,
    cancel,
    claim,
    commit_motions,
    commit_texts,
    fail_items,
    heartbeat,
    pause,
    release,
    resume,
    retry,
    set_fail_early,
    set_priority,
    sweep,
)
from marey.takes import delete
from marey.tenants import set_quotas
from tests.servers.audit import audit
from tests.servers.jobs import PROBLEM, let_expire, make_due, motion_of, new_item, submit_items
from tests.support.webhooks import new_webhook

VERBS: dict[str, Callable[[sa.Connection, str, UUID], object]] = {
    "pause": pause,
    "resume": resume,
    "cancel": cancel,
    "retry": retry,
    "retry failed": partial(retry, failed_only=True),
    "priority": partial(set_priority, priority=7),
    "fail early": partial(set_fail_early, share=0.3),
    "fail never": partial(set_fail_early, share=None),
}
PROMPTS = st.sampled_from(["walk", "run", "jump", "wave"])


class Jobs(RuleBasedStateMachine):
    """Operators, workers (also ones that think they hold a lease and do not), time."""

    engine: sa.Engine
    jobs = Bundle("jobs")
    claims = Bundle("claims")

    def __init__(self) -> None:
        super().__init__()
        self.succeeded: dict[UUID, UUID] = {}
        with self.engine.begin() as conn:
            conn.execute(
                sa.text("TRUNCATE job, lease, asset, text_features, prompt_scope, webhook, webhook_event CASCADE")
            )
        new_webhook(self.engine)
        with transaction(self.engine) as conn:
            set_quotas(conn, "default", {"queued": 12, "running": 4})

    @rule(
        target=jobs,
        prompts=st.lists(PROMPTS, min_size=1, max_size=6),
        bundles=st.integers(1, 2),
        fail_early=st.sampled_from([None, None, 0.0, 0.5]),
    )
    def submit(self, prompts: list[str], bundles: int, fail_early: float | None):
        items = [new_item(n, prompt, bundle=f"{n % bundles}@0") for n, prompt in enumerate(prompts)]
        try:
            return submit_items(self.engine, items, fail_early=fail_early)
        except QuotaUsedUp:
            return multiple()

    @rule(target=claims, queue=st.sampled_from(["text", "hgm3"]), limit=st.integers(1, 4), loaded=st.booleans())
    def claim(self, queue: str, limit: int, loaded: bool):
        with transaction(self.engine) as conn:
            found = claim(conn, queue, "w", limit, prefer_batch_key="batch of 1@0" if loaded else None)
        return multiple() if found is None else found

    @rule(claimed=claims, share=st.integers(1, 4))
    def finish(self, claimed: Claim, share: int) -> None:
        items = claimed.items[:share]
        with transaction(self.engine) as conn:
            if claimed.queue == "text":
                texts = [NewText(item.id, item.text_key, item.prompt.encode()) for item in items]
                done = commit_texts(conn, claimed.lease_token, texts)
            else:
                motions = [motion_of(item.id, item.prompt.encode()) for item in items]
                if not begin_assets(conn, claimed.lease_token, [motion.files["npz"] for motion in motions]):
                    return
                done = commit_motions(conn, claimed.lease_token, motions)
        self.check(done, [item.id for item in items])

    @rule(claimed=claims, share=st.integers(1, 4), retryable=st.booleans())
    def fail(self, claimed: Claim, share: int, retryable: bool) -> None:
        failures = [ItemFailure(item.id, PROBLEM, retryable) for item in claimed.items[:share]]
        with transaction(self.engine) as conn:
            self.check(fail_items(conn, claimed.lease_token, failures), [failure.item for failure in failures])

    @rule(claimed=claims)
    def release(self, claimed: Claim) -> None:
        with transaction(self.engine) as conn:
            release(conn, claimed.lease_token, "stop")

    @rule(claimed=claims)
    def beat(self, claimed: Claim) -> None:
        items = [item.id for item in claimed.items]
        with transaction(self.engine) as conn:
            answer = heartbeat(conn, claimed.lease_token, items, progressed=True)
            held = "SELECT id FROM item WHERE lease_token = :token"
            ours = set(conn.execute(sa.text(held), {"token": claimed.lease_token}).scalars())
        assert answer.gone == set(items) - ours
        assert answer.lost == (not ours)

    @rule(claimed=consumes(claims))
    def lose(self, claimed: Claim) -> None:
        let_expire(self.engine, claimed.lease_token)
        sweep(self.engine)

    @rule()
    def time_passes(self) -> None:
        make_due(self.engine)
        sweep(self.engine)

    @rule(job=jobs, verb=st.sampled_from(sorted(VERBS)))
    def operate(self, job: UUID, verb: str) -> None:
        try:
            with transaction(self.engine) as conn:
                VERBS[verb](conn, "default", job)
        except (Conflict, NotFound, QuotaUsedUp):
            pass

    @rule(job=consumes(jobs))
    def delete(self, job: UUID) -> None:
        try:
            with transaction(self.engine) as conn:
                delete(conn, "default", job)
                gone = "SELECT item_id FROM motion WHERE job_id = :job"
                assert conn.execute(sa.text(gone), {"job": job}).all() == []
        except Conflict:
            return
        with transaction(self.engine) as conn:
            left = set(conn.execute(sa.text("SELECT id FROM item")).scalars())
        self.succeeded = {item: motion for item, motion in self.succeeded.items() if item in left}

    @invariant()
    def the_tables_hold_together(self) -> None:
        with transaction(self.engine) as conn:
            assert audit(conn) == []

    @invariant()
    def what_succeeded_stays_with_its_first_motion(self) -> None:
        with transaction(self.engine) as conn:
            rows = conn.execute(sa.text("SELECT item_id, id FROM motion")).all()
        now = {row.item_id: row.id for row in rows}
        assert now.items() >= self.succeeded.items()
        self.succeeded = now

    @staticmethod
    def check(done: Committed, asked: list[UUID]) -> None:
        assert sorted(done.items + done.lost) == sorted(asked)


@pytest.mark.parametrize("walks", [12, pytest.param(60, marks=pytest.mark.slow)])
def test_no_order_of_events_breaks_the_tables(engine: sa.Engine, walks: int) -> None:
    class OnThisDatabase(Jobs):
        pass

    OnThisDatabase.engine = engine
    run_state_machine_as_test(
        OnThisDatabase,
        settings=settings(
            max_examples=walks,
            stateful_step_count=30,
            deadline=None,
            suppress_health_check=[HealthCheck.too_slow],
            phases=[Phase.explicit, Phase.generate],  # shrinking against a database takes minutes
            database=None,
        ),
    )
