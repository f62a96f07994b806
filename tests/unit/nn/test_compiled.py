"""Modules that are compiled once they are used often."""

from __future__ import annotations

import sys

import pytest
import torch
from torch import nn

from marey.nn.compiled import OFTEN, CompiledLater, compiled


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="torch does not compile scripts there")
def test_a_module_is_compiled_when_it_has_been_used_often_and_computes_the_same() -> None:
    module, x = nn.Sequential(nn.Linear(3, 4), nn.GELU()).requires_grad_(False), torch.randn(2, 3)
    later = CompiledLater(module)
    assert all(later.get() is module for _ in range(OFTEN))
    script = later.get()
    assert isinstance(script, torch.jit.ScriptModule)
    assert later.get() is script, "once"
    assert torch.equal(script(x), module(x))


def test_where_torch_compiles_no_scripts_the_module_is_used_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    module = nn.Linear(3, 4)
    monkeypatch.setattr(sys, "version_info", (3, 14))
    assert compiled(module) is module
