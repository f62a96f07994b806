"""Conversion of model configurations to and from plain JSON values, for manifests and checkpoints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass
from typing import Any, Self, TypeVar, cast, get_type_hints

from marey.core.errors import InvalidInput

T = TypeVar("T")


@dataclass(frozen=True)
class ModelConfig:
    """Base class of configurations that decide a model's shapes and training."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values, for manifests and checkpoints."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Rebuild a configuration from `to_dict`'s output (lists become tuples).

        Raises:
            InvalidInput: an unknown field.
        """
        return build_config(cls, values)


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
