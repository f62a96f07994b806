"""Networks write tensors under their stored names, and load both names."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import Tensor, nn

from marey.nn.ema import WeightAverage
from marey.nn.stored_names import keep_stored_names, stored_parameters

STORED = ["inner.enter.weight", "inner.enter.bias", "inner.leave.weight", "inner.leave.bias", "enter"]


class Inner(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.in_proj, self.out_proj = nn.Linear(2, 3), nn.Linear(3, 2)
        keep_stored_names(self)


class Network(nn.Module):
    """A parameter of its own is called `enter`, too: only the projections are renamed."""

    def __init__(self) -> None:
        super().__init__()
        self.enter = nn.Parameter(torch.zeros(1))
        self.inner = Inner()


def renamed(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """The same tensors under the attributes' names."""
    return {name.replace("inner.enter", "inner.in_proj").replace("leave", "out_proj"): v for name, v in state.items()}


def test_tensors_are_written_under_their_stored_names() -> None:
    assert sorted(Network().state_dict()) == sorted(STORED)
    assert sorted(copy.deepcopy(Network()).state_dict()) == sorted(STORED)
    assert sorted(name for name, _ in stored_parameters(Network())) == sorted(STORED)


@pytest.mark.parametrize("names", [dict, renamed], ids=["stored", "attributes"])
def test_both_names_load(names: type) -> None:
    state, target = Network().state_dict(), Network()
    target.load_state_dict(names(state))
    assert all(torch.equal(value, state[name]) for name, value in target.state_dict().items())


@pytest.mark.parametrize("names", [dict, renamed], ids=["stored", "attributes"])
def test_an_average_of_either_name_is_restored(names: type) -> None:
    source, average = WeightAverage(Network(), 0.9), WeightAverage(Network(), 0.9)
    assert sorted(source.values) == sorted(STORED)
    average.load(names(source.values))
    assert all(torch.equal(value, source.values[name]) for name, value in average.values.items())


def test_a_missing_tensor_is_refused() -> None:
    state = Network().state_dict()
    del state["inner.leave.bias"]
    with pytest.raises(RuntimeError, match="out_proj"):
        Network().load_state_dict(state)
    with pytest.raises(KeyError):
        WeightAverage(Network(), 0.9).load(state)
