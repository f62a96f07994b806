"""Reading takes one thread and gives the others back."""

from __future__ import annotations

import pytest
import torch

from marey.bundles import TextSpec
from marey.nn.threads import one_thread
from marey.text.pipeline import TextPipeline


@pytest.fixture(autouse=True)
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def test_the_threads_are_given_back_even_after_an_error():
    seen: list[int] = []

    @one_thread()
    def fail() -> None:
        seen.append(torch.get_num_threads())
        raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert [*seen, torch.get_num_threads()] == [1, 2]


def test_reading_a_prompt_leaves_the_threads_of_the_caller():
    pipeline = TextPipeline.load(TextSpec())
    pipeline.features(["a person walks"])
    assert torch.get_num_threads() == 2
