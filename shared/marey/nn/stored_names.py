"""Tensor names of bundles and checkpoints that differ from the attributes of today's networks.

The projections `in_proj` and `out_proj` were called `enter` and `leave` when the first bundles were written. A bundle's
hash covers its tensor names, so they are written as before; both names load.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor, nn

STORED_NAMES: Mapping[str, str] = {"in_proj": "enter", "out_proj": "leave"}
"""Stored name of each attribute."""


def keep_stored_names(module: nn.Module) -> None:
    """Write the direct children `in_proj` and `out_proj` of `module` under their stored names; load both names.

    Call it in the module's constructor. It covers `state_dict` and `load_state_dict` of the module and of every module
    that contains it; `named_parameters` has the attributes' names.
    """
    module.register_state_dict_post_hook(_write_stored)  # pyright: ignore[reportUnknownMemberType]
    module.register_load_state_dict_pre_hook(_read_stored)  # pyright: ignore[reportUnknownMemberType]


def stored_parameters(module: nn.Module) -> list[tuple[str, nn.Parameter]]:
    """Trainable parameters with their stored names, each once."""
    seen: dict[int, tuple[str, nn.Parameter]] = {}
    for name, value in module.state_dict(keep_vars=True).items():
        if isinstance(value, nn.Parameter) and value.requires_grad:
            seen.setdefault(id(value), (name, value))
    return list(seen.values())


def load_stored(values: Mapping[str, Tensor], name: str) -> Tensor:
    """The tensor stored under `name` or under the attribute's name of it; raise KeyError if neither exists."""
    if name in values:
        return values[name]
    attributes = {stored: attribute for attribute, stored in STORED_NAMES.items()}
    return values[".".join(attributes.get(part, part) for part in name.split("."))]


def _write_stored(_module: nn.Module, state: dict[str, Any], prefix: str, _metadata: object) -> None:
    _rename(state, {f"{prefix}{attribute}.": f"{prefix}{stored}." for attribute, stored in STORED_NAMES.items()})


def _read_stored(_module: nn.Module, state: dict[str, Any], prefix: str, *_rest: object) -> None:
    _rename(state, {f"{prefix}{stored}.": f"{prefix}{attribute}." for attribute, stored in STORED_NAMES.items()})


def _rename(state: dict[str, Any], prefixes: Mapping[str, str]) -> None:
    """Rename keys in place; the order stays."""
    items = list(state.items())
    state.clear()
    for name, value in items:
        for before, after in prefixes.items():
            if name.startswith(before):
                name = after + name.removeprefix(before)
        state[name] = value
