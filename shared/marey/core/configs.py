"""Configurations of models: plain JSON values for manifests and checkpoints, and the ranges of their numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, fields, is_dataclass
from types import MappingProxyType
from typing import Annotated, Any, Self, TypeVar, cast, get_type_hints

from marey.core.errors import InvalidInput

T = TypeVar("T")


@dataclass(frozen=True)
class Between:
    """Range of a number in a configuration, both ends included; checked where a user writes it, not in bundles."""

    low: float
    high: float = math.inf
    above: bool = False
    """`low` itself is excluded."""

    def contains(self, value: float) -> bool:
        """Return True if the number is finite and in the range."""
        return math.isfinite(value) and (value > self.low if self.above else value >= self.low) and value <= self.high

    def __str__(self) -> str:
        """Return the range for messages and documents: `0 to 1`, `at least 1`, `above 0, at most 1`."""
        if self.high == math.inf:
            return f"{'above' if self.above else 'at least'} {self.low:g}"
        return f"above {self.low:g}, at most {self.high:g}" if self.above else f"{self.low:g} to {self.high:g}"


Count = Annotated[int, Between(1)]
Whole = Annotated[int, Between(0)]
Weight = Annotated[float, Between(0)]
Positive = Annotated[float, Between(0, above=True)]
Share = Annotated[float, Between(0, 1)]
Part = Annotated[float, Between(0, 1, above=True)]
"""A share that is not 0."""
Momentum = Annotated[float, Between(0, 0.99999)]
"""Share of the old value in a moving average; at 1 nothing would move."""


ADDED = MappingProxyType({"added": True})
"""Metadata of a field that earlier releases do not know: at its default it is left out, so that they read bundles."""


@dataclass(frozen=True)
class ModelConfig:
    """Base class of configurations that decide a model's shapes and training."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values, for manifests and checkpoints."""
        return _plain(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Rebuild a configuration from `to_dict`'s output (lists become tuples).

        Raises:
            InvalidInput: an unknown field.
        """
        return build_config(cls, values)

    def check(self) -> None:
        """Check fields against each other where each alone is in its range; configuration files are checked by it.

        Raises:
            InvalidInput: they contradict each other; `where` is the field to change.
        """


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        own = {each.name: getattr(value, each.name) for each in fields(value) if not _is_left_out(value, each)}
        return {name: _plain(inner) for name, inner in own.items()}
    return value


def _is_left_out(value: Any, each: Field[Any]) -> bool:
    return each.metadata == ADDED and getattr(value, each.name) == each.default


def named(configs: Mapping[str, T], name: str) -> T:
    """Return one of several configurations by name.

    Raises:
        InvalidInput: the name is unknown.
    """
    if name not in configs:
        raise InvalidInput(f"unknown configuration {name!r}", hint=f"Known: {', '.join(configs)}.")
    return configs[name]


def build_config(kind: type[T], values: Mapping[str, Any], where: str = "config") -> T:
    """Build a frozen dataclass, with nested ones, from the output of `dataclasses.asdict` (lists become tuples).

    Raises:
        InvalidInput: an unknown field.
    """
    hints = get_type_hints(kind)
    unknown = set(values) - {f.name for f in fields(kind)}  # pyright: ignore[reportArgumentType]
    if unknown:
        raise InvalidInput(f"unknown fields: {', '.join(sorted(unknown))}", where=where)
    built: dict[str, Any] = {}
    for name, value in values.items():
        if is_dataclass(hints[name]) and isinstance(value, Mapping):
            value = build_config(hints[name], cast("Mapping[str, Any]", value), f"{where}.{name}")
        built[name] = tuple(cast("list[Any]", value)) if isinstance(value, list) else value
    return kind(**built)
