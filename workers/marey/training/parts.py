"""Output of a finished stage for the bundle: weights (the average), configuration, metrics and the data's hash."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from pydantic import TypeAdapter
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from marey.core.documents import read_json
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.data.licences import Terms

_TERMS = TypeAdapter(tuple[Terms, ...])


@dataclass(frozen=True)
class TrainedPart:
    """A trained part of a bundle."""

    state: dict[str, Tensor]
    config: dict[str, Any]
    metrics: dict[str, float]
    data_sha256: str
    budget: dict[str, Any]
    sources: tuple[Terms, ...] = ()
    """Data sets that it was trained on, and those of every part that it began from or was trained upon."""


def mean_part(parts: Mapping[str, TrainedPart]) -> TrainedPart:
    """Return the mean of the weights of several trainings of a stage (Wortsman et al. 2022, "Model soups").

    They must have begun from the same weights, or their mean is noise. The configuration is that of the last, and the
    mean has no metrics: it was not validated.

    Args:
        parts: at least two, by what they are called in errors.

    Raises:
        InvalidInput: a single part, other networks, or other data.
    """
    first, *rest = parts.values()
    if not rest:
        raise InvalidInput("is the only training", where=next(iter(parts)), hint="Name two or more.")
    shapes = {name: value.shape for name, value in first.state.items()}
    for where, part in parts.items():
        if {name: value.shape for name, value in part.state.items()} != shapes:
            raise InvalidInput("holds another network than the first", where=where)
        if part.data_sha256 != first.data_sha256:
            raise InvalidInput("was trained on other data than the first", where=where)
    state = {name: _mean([part.state[name] for part in parts.values()]) for name in shapes}
    budget = {"mean_of": [part.budget for part in parts.values()]}
    sources = tuple(dict.fromkeys(source for part in parts.values() for source in part.sources))
    return TrainedPart(state, rest[-1].config, {}, first.data_sha256, budget, sources)


def _mean(values: Sequence[Tensor]) -> Tensor:
    """Return the mean of floating numbers; of others, such as counters, the last."""
    if not values[0].is_floating_point():
        return values[-1]
    return torch.stack([value.float() for value in values]).mean(0).to(values[0].dtype)


def save_part(folder: Path, part: TrainedPart) -> None:
    """Write `weights.safetensors` and `part.json` (last: a part without it is unfinished)."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "part.json").unlink(missing_ok=True)
    weights = {k: v.detach().cpu().contiguous().clone() for k, v in part.state.items()}
    save_file(weights, folder / "weights.safetensors")
    values = {name: value for name, value in vars(part).items() if name != "state"}
    values["sources"] = [asdict(source) for source in part.sources]
    (folder / "part.json").write_text(json.dumps(values, indent=1), encoding="utf-8")


def load_sources(file: Path) -> tuple[Terms, ...]:
    """Data sets behind a part, by its `part.json`.

    Raises:
        InvalidFile: damaged.
    """
    try:
        return _TERMS.validate_python(read_json(file, allow_nan=True).get("sources", ()))
    except (AttributeError, TypeError, ValueError) as error:
        raise InvalidFile(f"is not a trained part: {error}", where=str(file)) from error


def load_part(folder: Path) -> TrainedPart:
    """Read a finished part.

    Raises:
        NotFound: the stage has not finished.
        InvalidFile: damaged.
    """
    try:
        values = read_json(folder / "part.json", allow_nan=True)
    except NotFound:
        raise NotFound(
            "this stage has not finished", where=str(folder.parent), hint="Train it first, or resume it."
        ) from None
    try:
        state = load_file(folder / "weights.safetensors")
        sources = _TERMS.validate_python(values.get("sources", ()))
        return TrainedPart(
            state, values["config"], values["metrics"], values["data_sha256"], values.get("budget", {}), sources
        )
    except (AttributeError, KeyError, TypeError, ValueError, SafetensorError, OSError) as error:
        raise InvalidFile(f"is not a trained part: {error}", where=str(folder)) from error
