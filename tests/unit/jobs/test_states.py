"""The table of transitions and the state of a job."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import pytest

from marey.evaluations.states import EVALUATION_TRANSITIONS, OPEN_EVALUATIONS, EvaluationState
from marey.jobs.states import (
    ENDED,
    OPEN,
    RETRYABLE,
    TRANSITIONS,
    Cause,
    ItemState,
    JobControl,
    JobState,
    allowed,
    job_state,
)

# The contract, written down a second time, on purpose.
CONTRACT = {
    "ready": {"leased", "cancelled"},
    "leased": {"succeeded", "ready", "failed", "dead", "cancelled"},
    "succeeded": set(),
    "failed": {"ready"},
    "dead": {"ready"},
    "cancelled": {"ready"},
}
EVALUATION_CONTRACT = {
    "planned": {"generating", "failed", "cancelled"},
    "generating": {"scoring", "failed", "cancelled"},
    "scoring": {"done", "failed", "cancelled"},
    "done": set(),
    "failed": set(),
    "cancelled": set(),
}


@dataclass(frozen=True)
class Items:
    ready: int = 0
    leased: int = 0
    succeeded: int = 0
    failed: int = 0
    dead: int = 0
    cancelled: int = 0

    @property
    def total(self) -> int:
        return self.ready + self.leased + self.succeeded + self.failed + self.dead + self.cancelled


@pytest.mark.parametrize(("before", "after"), list(product(ItemState, ItemState)))
def test_an_item_moves_as_the_contract_says(before: ItemState, after: ItemState) -> None:
    assert allowed(before, after) == (str(after) in CONTRACT[str(before)])


def test_an_evaluation_moves_as_the_contract_says() -> None:
    found = {str(before): set(map(str, after)) for before, after in EVALUATION_TRANSITIONS.items()}
    assert found == EVALUATION_CONTRACT


def test_an_evaluation_is_open_exactly_while_it_can_move() -> None:
    assert {state for state in EvaluationState if EVALUATION_TRANSITIONS[state]} == OPEN_EVALUATIONS


def test_succeeded_is_final() -> None:
    assert not any(before is ItemState.SUCCEEDED for before, _ in TRANSITIONS)


def test_every_transition_has_a_cause_and_every_cause_is_used() -> None:
    assert all(TRANSITIONS.values())
    assert frozenset(Cause) == frozenset().union(*TRANSITIONS.values())


def test_what_may_be_retried_is_neither_open_nor_succeeded() -> None:
    assert RETRYABLE | OPEN | {ItemState.SUCCEEDED} == set(ItemState)
    assert all(allowed(state, ItemState.READY) for state in RETRYABLE)


@pytest.mark.parametrize(
    ("items", "control", "started", "state"),
    [
        (Items(ready=3), JobControl.RUN, False, JobState.QUEUED),
        (Items(ready=2, leased=1), JobControl.RUN, True, JobState.RUNNING),
        (Items(ready=3), JobControl.RUN, True, JobState.RUNNING),
        (Items(ready=2, succeeded=1), JobControl.RUN, True, JobState.RUNNING),
        (Items(ready=2, leased=1), JobControl.PAUSED, True, JobState.PAUSED),
        (Items(succeeded=3), JobControl.RUN, True, JobState.SUCCEEDED),
        (Items(succeeded=3), JobControl.PAUSED, True, JobState.SUCCEEDED),
        (Items(succeeded=3), JobControl.CANCELLED, True, JobState.SUCCEEDED),
        (Items(succeeded=2, failed=1), JobControl.RUN, True, JobState.PARTIAL),
        (Items(succeeded=2, cancelled=1), JobControl.CANCELLED, True, JobState.CANCELLED),
        (Items(succeeded=2, cancelled=1), JobControl.RUN, True, JobState.PARTIAL),
        (Items(failed=1, dead=2), JobControl.RUN, True, JobState.FAILED),
        (Items(cancelled=3), JobControl.CANCELLED, False, JobState.CANCELLED),
    ],
)
def test_the_state_of_a_job_follows_its_items(
    items: Items, control: JobControl, started: bool, state: JobState
) -> None:
    assert job_state(control, items, started=started) is state


def test_a_job_has_ended_exactly_when_nothing_is_open() -> None:
    for counts in product((0, 1), repeat=6):
        for control, started in product(JobControl, (False, True)):
            items = Items(*counts)
            if items.total:
                ended = job_state(control, items, started=started) in ENDED
                assert ended == (items.ready + items.leased == 0)
