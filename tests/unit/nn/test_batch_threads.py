"""Parts of a batch on threads of their own."""

from __future__ import annotations

import copy
import threading
from collections.abc import Iterator

import pytest
import torch

from marey.nn.batch_threads import BatchThreads


@pytest.fixture(autouse=True)
def threads() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def test_rows_are_shared_equally_and_no_part_is_empty() -> None:
    batch_threads = BatchThreads(3)
    assert [part.stop - part.start for part in batch_threads.parts(8)] == [2, 3, 3]
    assert batch_threads.parts(2) == [slice(0, 1), slice(1, 2)]
    assert BatchThreads(1).parts(8) == [slice(0, 8)]


def test_results_stand_in_the_order_of_the_parts() -> None:
    first, batch_threads = threading.Event(), BatchThreads(2)

    def wait_for_the_second(part: int) -> int:
        if part:
            first.set()
        elif not first.wait(60):
            raise TimeoutError("the parts do not run side by side")
        return part

    assert batch_threads.map(wait_for_the_second, [0, 1]) == [0, 1]


def test_a_batch_thread_has_one_torch_thread_no_gradients_and_is_not_split_again() -> None:
    batch_threads = BatchThreads(2)

    def inside(_: int) -> tuple[int, bool, int, bool]:
        names = batch_threads.map(lambda _: threading.current_thread().name, batch_threads.parts(8))
        here = threading.current_thread().name in names
        return torch.get_num_threads(), torch.is_inference_mode_enabled(), len(names), here

    assert batch_threads.map(inside, [0, 1]) == [(1, True, 1, True)] * 2


def test_the_caller_has_one_torch_thread_while_batch_threads_compute() -> None:
    batch_threads = BatchThreads(2)
    with batch_threads.open():
        assert torch.get_num_threads() == 1
        batch_threads.map(int, [0, 1])
    assert torch.get_num_threads() == 2
    with BatchThreads(1).open():
        assert torch.get_num_threads() == 2


def test_an_error_of_one_part_is_raised_when_all_are_through() -> None:
    batch_threads, through = BatchThreads(2), list[int]()

    def fail_first(part: int) -> None:
        if part == 0:
            raise ValueError("part 0 is broken")
        through.append(part)

    with pytest.raises(ValueError, match="part 0 is broken"):
        batch_threads.map(fail_first, [0, 1, 2, 3])
    assert sorted(through) == [1, 2, 3]


def test_a_copied_network_shares_its_batch_threads() -> None:
    batch_threads = BatchThreads(2)
    batch_threads.map(lambda part: part, [0, 1])  # started: threads cannot be copied
    assert copy.deepcopy({"lanes": batch_threads})["lanes"] is batch_threads
