"""Checkpoints of other projects, read without running their code, with an account of every tensor.

    checkpoint = Checkpoint.open(file)
    tokenizer = checkpoint.section("vq_model", "model")  # the first of these keys that the file has
    tokenizer.fill(network, own_to_published)
    tokenizer.ignore(r"position_enc\\.pe", "computed anew")
    account = checkpoint.finish()  # refuses tensors that are neither read nor ignored

`torch.load` runs with `weights_only=True`: tensors and plain values load, everything else is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from marey.core.errors import InvalidFile
from marey.core.hashing import sha256_of
from marey.importing.torch_files import MAX_BYTES, load_torch, tensors_in
from marey.nn.bundling import NOT_STORED

SHOWN = 5
"""Names in a message; the rest is counted."""
TRAINING_STATE: Mapping[str, str] = {
    r"(opt|optimizer|optim)(_.*)?": "state of an optimizer",
    r"(scheduler|slr|lr_scheduler)(_.*)?": "state of a schedule of the learning rate",
    r"ema_model": "running average of the weights, kept for training",
}
"""Entries of checkpoints, beside the weights, that only a resumed training reads."""

Names = Callable[[str], str]
"""The published name of one of our tensors."""


@dataclass(frozen=True)
class Account:
    """The tensors of one imported file.

    Attributes:
        file: as found, relative to the folder that is imported where it lies in it.
        bytes, sha256: of the file.
        used: names of the tensors that are in the bundle.
        ignored: names of tensors and entries that are left out, each with its reason.
    """

    file: str
    bytes: int
    sha256: str
    used: tuple[str, ...] = ()
    ignored: Mapping[str, str] | None = None


class Section:
    """One table of tensors of a checkpoint; every tensor has to be taken or ignored."""

    def __init__(self, where: str, prefix: str, tensors: Mapping[str, Tensor]) -> None:
        """Create a section; callers use `Checkpoint.section`."""
        self.where = where
        self._prefix = prefix
        self._tensors = dict(tensors)
        self._used: list[str] = []
        self._ignored: dict[str, str] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all its tensors."""
        return tuple(self._tensors)

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of a tensor.

        Raises:
            InvalidFile: there is none of this name.
        """
        if name not in self._tensors:
            raise self._broken(f"lacks the tensor {name}")
        return tuple(self._tensors[name].shape)

    def take(self, name: str, shape: Sequence[int | None] | None = None) -> Tensor:
        """Return a tensor in float32 and count it as used.

        Args:
            name: as published.
            shape: required length of each axis (None = any); None = any shape.

        Raises:
            InvalidFile: it is missing, of another shape, not of floating numbers, or holds NaN or infinite numbers.
        """
        if problem := self._problem(name, shape):
            raise self._broken(problem)
        if name not in self._used:
            self._used.append(name)
        return self._tensors[name].detach().float().contiguous()

    def fill(
        self, network: nn.Module, names: Names = lambda name: name, *, made: Mapping[str, Tensor] | None = None
    ) -> None:
        """Load tensors into a network in place and switch it to evaluation mode.

        Args:
            network: ours; its `state_dict` names what is needed, but for what bundles do not store.
            names: the published name of each.
            made: by our name, tensors that the caller made of several or reshaped ones.

        Raises:
            InvalidFile: one is missing, has another shape, is not of floating numbers, or holds NaN or infinite
                numbers; the message lists the first ones.
        """
        made = made or {}
        own: dict[str, Tensor] = {k: v for k, v in network.state_dict().items() if k not in NOT_STORED}
        wanted = {name: names(name) for name in own if name not in made}
        problems = [p for name, published in wanted.items() if (p := self._problem(published, own[name].shape))]
        problems += [
            f"{name} would have shape {tuple(value.shape)}, not {tuple(own[name].shape)}"
            for name, value in made.items()
            if value.shape != own[name].shape
        ]
        if problems:
            raise self._broken(_listed(problems, "; "))
        state = {name: self.take(published) for name, published in wanted.items()}
        network.load_state_dict({**state, **made}, strict=False)
        network.eval().requires_grad_(False)

    def ignore(self, pattern: str, reason: str) -> None:
        """Leave out the tensors whose whole name matches a regular expression; there may be none."""
        for name in self._tensors:
            if re.fullmatch(pattern, name) and name not in self._used:
                self._ignored[name] = reason

    @property
    def used(self) -> tuple[str, ...]:
        """Full names of the tensors that were taken."""
        return tuple(self._prefix + name for name in self._used)

    @property
    def ignored(self) -> dict[str, str]:
        """Full names of the tensors that are left out, with reasons."""
        return {self._prefix + name: reason for name, reason in self._ignored.items()}

    @property
    def unknown(self) -> tuple[str, ...]:
        """Full names of the tensors that are neither taken nor ignored."""
        left = (name for name in self._tensors if name not in self._ignored and name not in self._used)
        return tuple(self._prefix + name for name in left)

    def _problem(self, name: str, shape: Sequence[int | None] | None) -> str | None:
        value = self._tensors.get(name)
        if value is None:
            return f"lacks the tensor {name}"
        if shape is not None and not _fits(value.shape, shape):
            wanted = tuple("any" if n is None else n for n in shape)
            return f"{name} has shape {tuple(value.shape)}, not {wanted}"
        if not value.is_floating_point() or value.layout is not torch.strided or value.is_quantized:
            return f"{name} holds {value.dtype}, not floating numbers"
        if not bool(torch.isfinite(value).all()):
            return f"{name} holds NaN or infinite numbers"
        return None

    def _broken(self, message: str) -> InvalidFile:
        return InvalidFile(
            message, where=self.where, hint="Download the file again; else these are weights of another configuration."
        )


class Checkpoint:
    """A loaded file. Open one with `Checkpoint.open`."""

    def __init__(self, file: Path, shown: str, entries: Mapping[str, Any]) -> None:
        self.file = file
        self._shown = shown
        self._entries = entries
        self._sections: dict[str, Section] = {}
        self._patterns = dict(TRAINING_STATE)

    @classmethod
    def open(cls, file: Path, *, shown: str | None = None, limit: int = MAX_BYTES) -> Checkpoint:
        """Load a file that `torch.save` wrote: .tar, .pt, .pth, .ckpt, .bin.

        Args:
            file: the file.
            shown: its name in the account; None = its path.
            limit: maximum size in bytes.

        Raises:
            NotFound: there is no such file.
            InvalidFile: over the limit, truncated, of another format, or with Python objects.
        """
        return cls(file, shown or str(file), load_torch(file, limit=limit))

    @property
    def keys(self) -> tuple[str, ...]:
        """The entries of the file."""
        return tuple(map(str, self._entries))

    def section(self, *keys: str) -> Section:
        """Return the table of tensors under the first of these keys that the file has.

        Raises:
            InvalidFile: it has none of them, or something else stands there.
        """
        key = next((key for key in keys if key in self._entries), None)
        if key is None:
            raise InvalidFile(
                f"has no {' or '.join(map(repr, keys))}",
                where=str(self.file),
                hint=f"It holds: {_listed(self.keys)}. Is it a file of another part?",
            )
        if key not in self._sections:
            self._sections[key] = Section(f"{self.file}: {key}", f"{key}.", _table(self._entries[key], self.file, key))
        return self._sections[key]

    def whole(self) -> Section:
        """Return the file itself as a table of tensors, where weights are saved without a key.

        Raises:
            InvalidFile: it holds something else.
        """
        if "" not in self._sections:
            self._sections[""] = Section(str(self.file), "", _table(self._entries, self.file, None))
        return self._sections[""]

    def ignore(self, pattern: str, reason: str) -> None:
        """Leave out whole entries whose key matches a regular expression; see also `TRAINING_STATE`."""
        self._patterns[pattern] = reason

    def finish(self) -> Account:
        """Return the account of the file.

        Raises:
            InvalidFile: it holds tensors that were neither taken nor ignored; lists them.
        """
        ignored = {name: why for section in self._sections.values() for name, why in section.ignored.items()}
        unknown = [name for section in self._sections.values() for name in section.unknown]
        for key, value in self._entries.items():
            if key in self._sections or "" in self._sections or not any(True for _ in tensors_in(value)):
                continue
            reason = next((why for pattern, why in self._patterns.items() if re.fullmatch(pattern, key)), None)
            if reason is None:
                unknown.append(key)
            else:
                ignored[key] = reason
        if unknown:
            raise InvalidFile(
                f"holds tensors that this import does not know: {_listed(unknown)}",
                where=str(self.file),
                hint="These are weights of another version or configuration, which would not be read whole.",
            )
        used = tuple(name for section in self._sections.values() for name in section.used)
        return Account(self._shown, self.file.stat().st_size, sha256_of(self.file), used, ignored)


def _table(value: object, file: Path, key: str | None) -> Mapping[str, Tensor]:
    where = str(file) if key is None else f"{file}: {key}"
    if not isinstance(value, Mapping) or not value:
        raise InvalidFile("does not hold tensors by name", where=where, hint="Download the file again.")
    for name, each in value.items():
        if not isinstance(name, str) or not isinstance(each, Tensor):
            raise InvalidFile(f"holds {type(each).__name__} as {name!r}, not a tensor", where=where)
    return value


def _fits(found: Sequence[int], wanted: Sequence[int | None]) -> bool:
    return len(found) == len(wanted) and all(w is None or w == f for f, w in zip(found, wanted, strict=True))


def _listed(names: Sequence[str], separator: str = ", ") -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return separator.join(names[:SHOWN]) + more
