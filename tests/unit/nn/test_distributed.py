"""Gradients and codes of several processes, of which one is played."""

from __future__ import annotations

import pytest
import torch
import torch.distributed as dist

from marey.nn import distributed
from marey.nn.quantizer import ResidualQuantizer


def test_gradients_are_averaged_parameter_by_parameter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(distributed, "is_distributed", lambda: True)
    monkeypatch.setattr(dist, "get_world_size", lambda: 2)
    monkeypatch.setattr(dist, "all_reduce", lambda tensor: tensor.add_(tensor))  # the other process has the same
    first, second, still = (torch.nn.Parameter(torch.zeros(shape)) for shape in ((2, 2), (3,), (1,)))
    first.grad, second.grad = torch.arange(4.0).view(2, 2), torch.tensor([5.0, 6.0, 7.0])
    distributed.average_gradients([first, second, still])
    assert torch.equal(first.grad, torch.arange(4.0).view(2, 2))
    assert torch.equal(second.grad, torch.tensor([5.0, 6.0, 7.0]))
    assert still.grad is not None
    assert not still.grad.any()


class Other:
    """Process 0 of two, played: this one is process 1."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, theirs: torch.Tensor | None) -> None:
        """`theirs`: what the other process has to share."""
        self.theirs = theirs
        self.sent: list[torch.Tensor] = []
        monkeypatch.setattr(distributed.dist, "is_initialized", lambda: True)
        monkeypatch.setattr(dist, "get_world_size", lambda: 2)
        monkeypatch.setattr(dist, "get_rank", lambda: 1)
        monkeypatch.setattr(dist, "all_reduce", self.all_reduce)
        monkeypatch.setattr(dist, "broadcast", self.broadcast)

    def all_reduce(self, tensor: torch.Tensor) -> None:
        """Say who has something; of sums the other process has nothing."""
        if tensor.shape == (2,):
            tensor[0] += float(self.theirs is not None)

    def broadcast(self, tensor: torch.Tensor, src: int) -> None:
        """Hand over what one of the two has."""
        if src == 0:
            assert self.theirs is not None
            tensor.copy_(self.theirs)
        else:
            self.sent.append(tensor.clone())


def test_the_first_process_that_has_something_gives_it_to_all(monkeypatch: pytest.MonkeyPatch) -> None:
    mine, theirs = torch.ones(3), torch.full((3,), 7.0)
    like = torch.zeros(3)
    assert distributed.broadcast_any(mine, like) is mine, "alone"
    assert distributed.rank() == 0
    other = Other(monkeypatch, theirs)
    assert distributed.rank() == 1
    for given in (None, mine.clone()):
        assert torch.equal(distributed.broadcast_any(given, like), theirs)
    assert torch.equal(distributed.broadcast(like.clone()), theirs)
    other.theirs = None
    assert torch.equal(distributed.broadcast_any(mine, like), mine)
    assert [each.tolist() for each in other.sent] == [mine.tolist()]
    assert distributed.broadcast_any(None, like) is None
    assert not like.any()


def test_codes_of_a_process_without_vectors_are_those_of_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    theirs = torch.randn(4, 3)
    nothing = torch.zeros(2, 5, dtype=torch.bool)
    for shared in (theirs, None):
        quantizer = ResidualQuantizer(1, 4, 3, dropout=0.0).train()
        Other(monkeypatch, shared)
        quantizer(torch.randn(2, 5, 3), nothing)
        assert torch.equal(quantizer.codebooks[0], torch.zeros(4, 3) if shared is None else theirs)


def test_codes_of_two_processes_move_as_those_of_one_that_has_the_vectors_of_both(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both have the same vectors here: each sum is twice its own."""

    def trained(vectors: torch.Tensor) -> ResidualQuantizer:
        torch.manual_seed(0)
        made = ResidualQuantizer(1, 4, 3, decay=0.5, dropout=0.0, revive=0.0).train()
        made.codebooks.normal_()
        made.sums.copy_(made.codebooks * 4)
        made.counts.fill_(4.0)
        made.initialized.fill_(True)
        made(vectors)
        return made

    own = torch.randn(2, 5, 3)
    alone = trained(torch.cat([own, own]))
    Other(monkeypatch, torch.zeros(4, 3))
    monkeypatch.setattr(dist, "all_reduce", lambda tensor: tensor.add_(tensor))
    together = trained(own)
    torch.testing.assert_close(together.counts, alone.counts)
    torch.testing.assert_close(together.codebooks, alone.codebooks)
