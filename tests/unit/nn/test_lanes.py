"""Parts of a batch on threads of their own."""

from __future__ import annotations

import copy
import threading
from collections.abc import Iterator

import pytest
import torch

from marey.nn.lanes import Lanes


@pytest.fixture(autouse=True)
def threads() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def test_rows_are_shared_equally_and_no_part_is_empty() -> None:
    lanes = Lanes(3)
    assert [part.stop - part.start for part in lanes.parts(8)] == [2, 3, 3]
    assert lanes.parts(2) == [slice(0, 1), slice(1, 2)]
    assert Lanes(1).parts(8) == [slice(0, 8)]


def test_results_stand_in_the_order_of_the_parts() -> None:
    first, lanes = threading.Event(), Lanes(2)

    def wait_for_the_second(part: int) -> int:
        if part:
            first.set()
        elif not first.wait(60):
            raise TimeoutError("the parts do not run side by side")
        return part

    assert lanes.map(wait_for_the_second, [0, 1]) == [0, 1]


def test_a_lane_has_one_torch_thread_no_gradients_and_is_not_split_again() -> None:
    lanes = Lanes(2)

    def inside(_: int) -> tuple[int, bool, int, bool]:
        names = lanes.map(lambda _: threading.current_thread().name, lanes.parts(8))
        here = threading.current_thread().name in names
        return torch.get_num_threads(), torch.is_inference_mode_enabled(), len(names), here

    assert lanes.map(inside, [0, 1]) == [(1, True, 1, True)] * 2


def test_the_caller_has_one_torch_thread_while_lanes_are_open_and_its_own_behind_them() -> None:
    lanes = Lanes(2)
    with lanes.open():
        assert torch.get_num_threads() == 1
        lanes.map(int, [0, 1])
    assert torch.get_num_threads() == 2
    with Lanes(1).open():
        assert torch.get_num_threads() == 2


def test_an_error_of_one_part_is_raised_when_all_are_through() -> None:
    lanes, through = Lanes(2), list[int]()

    def fail_first(part: int) -> None:
        if part == 0:
            raise ValueError("part 0 is broken")
        through.append(part)

    with pytest.raises(ValueError, match="part 0 is broken"):
        lanes.map(fail_first, [0, 1, 2, 3])
    assert sorted(through) == [1, 2, 3]


def test_a_copy_of_what_holds_lanes_computes_in_the_same_ones() -> None:
    lanes = Lanes(2)
    lanes.map(lambda part: part, [0, 1])  # started: threads cannot be copied
    assert copy.deepcopy({"lanes": lanes})["lanes"] is lanes
