import threading
import time

import pytest
import torch

from marey.core.errors import InvalidInput, Unreachable
from marey.runtime.faults import (
    HandlerError,
    OutOfMemory,
    as_problem,
    is_device_lost,
    is_out_of_memory,
    retry_unreachable,
)


class Door:
    """Opens at the n-th knock."""

    def __init__(self, opens_at: int) -> None:
        self.knocks = 0
        self.opens_at = opens_at

    def __call__(self) -> str:
        self.knocks += 1
        if self.knocks < self.opens_at:
            raise Unreachable("closed")
        return "open"


def test_an_outage_shorter_than_the_patience_is_ridden_out() -> None:
    assert retry_unreachable(Door(3), seconds=30.0) == "open"


def test_a_longer_outage_is_told() -> None:
    door = Door(10**6)
    with pytest.raises(Unreachable, match="closed"):
        retry_unreachable(door, seconds=0.5)
    assert door.knocks > 1


def test_other_errors_are_not_retried() -> None:
    calls: list[int] = []

    def refuse() -> None:
        calls.append(1)
        raise InvalidInput("no")

    with pytest.raises(InvalidInput):
        retry_unreachable(refuse, seconds=5.0)
    assert len(calls) == 1


def test_a_stop_ends_the_patience_at_once() -> None:
    stopping = threading.Event()
    threading.Timer(0.3, stopping.set).start()
    started = time.monotonic()
    with pytest.raises(Unreachable):
        retry_unreachable(Door(10**6), seconds=60.0, stopping=stopping)
    assert time.monotonic() - started < 30.0


def test_torch_running_out_of_memory_is_recognised() -> None:
    with pytest.raises(RuntimeError) as caught:
        torch.empty(2**60, dtype=torch.uint8)
    assert is_out_of_memory(caught.value)
    assert is_out_of_memory(torch.OutOfMemoryError("CUDA out of memory"))
    assert is_out_of_memory(MemoryError())
    assert not is_out_of_memory(RuntimeError("shapes do not match"))


def test_a_lost_accelerator_is_recognised() -> None:
    assert is_device_lost(torch.AcceleratorError("CUDA error: device-side assert triggered", 710))
    assert not is_device_lost(RuntimeError("CUDA is nice"))
    assert not is_device_lost(torch.OutOfMemoryError("CUDA out of memory"))


def test_the_text_of_a_bug_is_not_told_because_it_may_quote_the_prompt() -> None:
    problem = as_problem(ValueError("bad prompt: a secret scene"))
    assert isinstance(problem, HandlerError)
    assert "secret" not in str(problem)
    assert "ValueError" in problem.message


def test_memory_and_expected_errors_keep_their_meaning() -> None:
    assert isinstance(as_problem(MemoryError()), OutOfMemory)
    expected = InvalidInput("too long")
    assert as_problem(expected) is expected
