"""A device that is not the processor, on machines that have none: tensors of their own kind, computed on the processor.

What a GPU refuses is refused here too: operators over tensors of two devices. And it is noted when the host waits for a
value (`waits`), which a step that is recorded must not do. What a GPU adds of its own, kernels, their rounding and
autocast, is for the tests marked `gpu` on a machine that has one.

The device changes the whole process, so checks on it run in processes of their own (`tests.support.card_checks`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map
from torch.utils.backend_registration import _DummyBackendModule, _setup_privateuseone_for_python_backend

CARD = "card"
COPIES = ("aten::_to_copy", "aten::copy_")
INDEXED = ("aten::index", "aten::index_put_", "aten::_index_put_impl_")
"""A GPU takes indices from the processor."""
waits: list[str] = []
"""Operators that brought values to the host, in order."""


class CardTensor(Tensor):
    """A tensor that says it lies on the card."""

    held: Tensor

    @staticmethod
    def __new__(cls, held: Tensor) -> CardTensor:
        """Wrap what lies on the processor."""
        made: CardTensor = torch.Tensor._make_wrapper_subclass(
            cls,
            held.size(),
            strides=held.stride(),
            storage_offset=held.storage_offset(),
            dtype=held.dtype,
            layout=held.layout,
            device=torch.device(CARD, 0),
        )
        made.held = held
        return made

    def tolist(self) -> Any:
        """Values; torch refuses them of tensors of other kinds."""
        return self.cpu().tolist()

    def __repr__(self, *, tensor_contents: object = None) -> str:
        return f"CardTensor({self.held!r})"

    @classmethod
    def __torch_dispatch__(
        cls, func: Any, types: Sequence[type], args: tuple[Any, ...] = (), kwargs: Mapping[str, Any] | None = None
    ) -> Any:
        return _run(func, args, dict(kwargs or {}))


class _Everything(TorchDispatchMode):
    """Sees also calls without a tensor of the card, as `torch.zeros(…, device="card")`."""

    def __torch_dispatch__(
        self, func: Any, types: Sequence[type], args: tuple[Any, ...] = (), kwargs: Mapping[str, Any] | None = None
    ) -> Any:
        return _run(func, args, dict(kwargs or {}))


class _Backend(_DummyBackendModule):
    """The part of torch's device API that is used."""

    def get_amp_supported_dtype(self) -> list[torch.dtype]:
        return [torch.bfloat16]

    def manual_seed_all(self, seed: int) -> None:
        """Random numbers come from the processor."""

    def _is_in_bad_fork(self) -> bool:
        return False


@contextmanager
def card() -> Iterator[torch.device]:
    """The device, as long as the block lasts; once in a process."""
    _setup_privateuseone_for_python_backend(CARD, backend_module=_Backend())
    torch._C._set_only_lift_cpu_tensors(True)  # else `torch.tensor` makes tensors unseen
    torch.__future__.set_overwrite_module_params_on_conversion(True)  # else `Module.to` leaves what is held behind
    with _Everything():
        yield torch.device(CARD, 0)


def _run(func: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """One operator, on the processor; its result lies where a GPU would have it."""
    if func._can_decompose():  # inference mode leaves that to us
        with _Everything():
            return func.decompose(*args, **kwargs)
    name = func.name().split(".")[0]
    target = kwargs.get("device")
    target = None if target is None else torch.device(target).type
    given = [each for each in tree_leaves((args, kwargs)) if isinstance(each, Tensor)]
    ours = [isinstance(each, CardTensor) for each in given if each.dim() or isinstance(each, CardTensor)]
    if any(ours):
        _refuse_two_devices(name, ours)
        to_host = target == "cpu" or (name == "aten::copy_" and not ours[0])
        if name == "aten::_local_scalar_dense" or (name in COPIES and to_host):
            waits.append(name)
    if target == CARD:
        kwargs["device"] = torch.device("cpu")
    result = func(*tree_map(_held, args), **tree_map(_held, kwargs))
    if target == "cpu" or not (any(ours) or target == CARD):
        return result
    if func._schema.is_mutable:
        return kwargs.get("out", args[0]) if func._schema.returns else None
    with torch.inference_mode(False):  # tensors made in it cannot be looked at through others
        return tree_map(lambda each: CardTensor(each) if isinstance(each, Tensor) else each, result)


def _refuse_two_devices(name: str, ours: Sequence[bool]) -> None:
    if not all(ours) and name not in COPIES and not (name in INDEXED and ours[0]):
        raise RuntimeError(f"{name}: tensors of two devices")


def _held(each: Any) -> Any:
    return each.held if isinstance(each, CardTensor) else each
