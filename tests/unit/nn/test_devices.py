"""The choice of a device, on a machine that has none or few."""

from __future__ import annotations

import pytest
import torch

from marey.core.errors import InvalidInput
from marey.nn.devices import choose_device


def test_a_card_that_the_machine_has_not_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert choose_device("cuda:1") == torch.device("cuda", 1)
    assert choose_device("cuda") == torch.device("cuda")
    with pytest.raises(InvalidInput, match="this machine has 2 CUDA devices"):
        choose_device("cuda:2")
