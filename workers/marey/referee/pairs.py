"""Minimal pairs: prompts that differ in one property, and whether the motions differ in it as asked.

Each pair names one property of one action: its side, number, order, direction, speed or duration. Both prompts are
generated with the same seed, and the pair is right only if both motions are. Speed alone is judged between the two.
"""

from __future__ import annotations

import tomllib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from marey.core.errors import InvalidInput
from marey.referee.adherence import interval
from marey.referee.body import Body
from marey.referee.properties import acting_side, direction, pace, repetitions
from marey.referee.rules import RULES
from marey.referee.sequences import shows, shows_in_order

Property: TypeAlias = Literal["side", "count", "order", "direction", "speed", "duration"]
PROPERTIES: tuple[Property, ...] = get_args(Property)
Value: TypeAlias = str | int | float | bool | tuple[str, ...]
FASTER = 1.2
"""How many times as fast the quick motion of a pair has to be as the slow one."""
LENGTH_TOLERANCE = 0.2
"""Share by which a motion may be longer or shorter than its prompt says."""


@dataclass(frozen=True)
class PairPrompt:
    """One prompt of a pair.

    Attributes:
        text: as a user types it.
        pair: number of the pair, counted from 0 over all properties.
        property: what the two prompts differ in.
        action: id of the vocabulary; also `step` and, of sides, what has no rule, such as `salute`; empty for an order.
        expected: the side, number, actions in order, direction, `slow` or `fast`, or seconds that the prompt asks for.
    """

    text: str
    pair: int
    property: Property
    action: str
    expected: Value


@dataclass(frozen=True)
class PairReading:
    """Measurement of one motion by the referee.

    Attributes:
        value: side, number, direction, speed or seconds of the motion; of an order, whether it is shown.
        shown: the motion shows the action, where that does not follow from the value.
    """

    prompt: PairPrompt
    seed: int
    value: Value
    shown: bool


@dataclass(frozen=True)
class PropertyRate:
    """How often the motions of a property are right.

    Attributes:
        pairs, motions: what it was measured on.
        single, pair: share of motions, and of pairs with one seed, that are right.
        single_interval, pair_interval: 95 % intervals, by prompts and by pairs as the sample size.
    """

    property: Property
    pairs: int
    motions: int
    single: float
    single_interval: tuple[float, float]
    pair: float
    pair_interval: tuple[float, float]


@lru_cache(maxsize=1)
def pair_prompts() -> tuple[PairPrompt, ...]:
    """Return the held-out prompts of all pairs, the two of a pair one after the other."""
    return _pairs("prompts_pairs.toml")


@lru_cache(maxsize=1)
def development_pairs() -> tuple[PairPrompt, ...]:
    """Return the prompts of the pairs by which settings are chosen, in the same order."""
    return _pairs("prompts_pairs_development.toml")


def _pairs(file: str) -> tuple[PairPrompt, ...]:
    pairs = tomllib.loads(Path(__file__).with_name(file).read_text("utf-8"))["pair"]
    return tuple(
        PairPrompt(
            text, number, pair["property"], pair.get("action", ""), tuple(want) if isinstance(want, list) else want
        )
        for number, pair in enumerate(pairs)
        for text, want in zip(pair["prompts"], pair["expected"], strict=True)
    )


def read_property(prompt: PairPrompt, seed: int, body: Body) -> PairReading:
    """Measure the property of a motion that its prompt names."""
    action = prompt.action
    match prompt.property:
        case "side":
            shown = action not in RULES or shows(action, body)
            return PairReading(prompt, seed, acting_side(action, body), shown)
        case "count":
            return PairReading(prompt, seed, repetitions(action, body), shown=True)
        case "order":
            assert isinstance(prompt.expected, tuple)
            return PairReading(prompt, seed, shows_in_order(prompt.expected, body), shown=True)
        case "direction":
            return PairReading(prompt, seed, direction(action, body), shown=True)
        case "speed":
            return PairReading(prompt, seed, round(pace(action, body), 3), shows(action, body))
        case "duration":
            return PairReading(prompt, seed, round(len(body) / body.fps, 3), shown=True)


def is_right(reading: PairReading, other: PairReading) -> bool:
    """Return True if a motion is as its prompt asks; `other` is the other motion of the pair."""
    expected, value = reading.prompt.expected, reading.value
    match reading.prompt.property:
        case "order":
            return bool(value)
        case "speed":
            assert isinstance(value, float)
            assert isinstance(other.value, float)
            slow, fast = (value, other.value) if expected == "slow" else (other.value, value)
            return reading.shown and fast >= FASTER * slow
        case "duration":
            assert isinstance(value, float)
            assert isinstance(expected, int | float)
            return abs(value - expected) <= LENGTH_TOLERANCE * expected
        case _:
            return reading.shown and value == expected


def property_rates(readings: Sequence[PairReading]) -> list[PropertyRate]:
    """Return the rate of each property, in the order of `PROPERTIES`.

    Raises:
        InvalidInput: a motion without the other of its pair.
    """
    of_pair = defaultdict[tuple[int, int], list[PairReading]](list)
    for reading in readings:
        of_pair[reading.prompt.pair, reading.seed].append(reading)
    verdicts = defaultdict[Property, list[tuple[bool, bool]]](list)
    numbers = defaultdict[Property, set[int]](set)
    for (number, seed), both in of_pair.items():
        if len(both) != 2:
            raise InvalidInput(f"pair {number} has {len(both)} motions of seed {seed}, not 2", where="readings")
        first, second = both
        verdicts[first.prompt.property].append((is_right(first, second), is_right(second, first)))
        numbers[first.prompt.property].add(number)
    return [_rate(name, verdicts[name], len(numbers[name])) for name in PROPERTIES if name in verdicts]


def _rate(name: Property, verdicts: Sequence[tuple[bool, bool]], pairs: int) -> PropertyRate:
    single = sum(map(sum, verdicts)) / (2 * len(verdicts))
    both = sum(map(all, verdicts)) / len(verdicts)
    return PropertyRate(
        name, pairs, 2 * len(verdicts), single, interval(single, 2 * pairs), both, interval(both, pairs)
    )


def pairs_markdown(bundle: str, found: Sequence[PropertyRate]) -> str:
    """Return a report with a table."""
    lines = [
        f"Bundle `{bundle}`, minimal pairs: a pair is right if both of its motions are.",
        "",
        "| property | pairs right | 95 % interval | motions right | 95 % interval | pairs | motions |",
        "|---|---|---|---|---|---|---|",
    ]
    for rate in found:
        lines.append(
            f"| {rate.property} | {rate.pair:.0%} | {_span(rate.pair_interval)} | {rate.single:.0%} "
            f"| {_span(rate.single_interval)} | {rate.pairs} | {rate.motions} |"
        )
    return "\n".join(lines) + "\n"


def _span(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:.0%} to {bounds[1]:.0%}"


def pairs_document(bundle: str, settings: Mapping[str, object], readings: Sequence[PairReading]) -> dict[str, Any]:
    """Return all data as JSON values, each motion included."""
    return {
        "bundle": bundle,
        "settings": dict(settings),
        "properties": [asdict(rate) for rate in property_rates(readings)],
        "motions": [asdict(reading) for reading in readings],
    }
