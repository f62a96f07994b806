"""Declaration of an operation, and the types of its parameters. Standard library only: the small client imports it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from marey.core.characters import is_printable

_FRAME = re.compile(r"f(\d{1,9})")
REQUIRED: Any = object()
"""Default of a parameter that has to be given."""

LONGEST_SENTENCE = 2000
MOST_FRAMES = 100_000
"""Of a motion, before and after each operation."""

Reader = Callable[[Any], Any]
"""Checks a value of JSON and returns it; raises ValueError with what is allowed."""


def moment(value: Any) -> float | str:
    """Read a time: seconds as a number, or a frame as `f12`; both count from the first frame."""
    if isinstance(value, str) and _FRAME.fullmatch(value):
        return value
    return number(0.0, 86400.0, "seconds from 0 on, or a frame such as f12")(value)


def frame_number(value: float | str, fps: float) -> int:
    """Return the frame nearest to a moment."""
    return int(value[1:]) if isinstance(value, str) else math.floor(value * fps + 0.5)


def number(low: float, high: float, allowed: str = "") -> Reader:
    """Return a reader of numbers between two bounds, both allowed."""

    def read(value: Any) -> float:
        fits = not isinstance(value, bool) and isinstance(value, int | float) and low <= value <= high
        if not fits:
            raise ValueError(allowed or f"a number from {low:g} to {high:g}")
        return float(value)

    return read


def choice(*allowed: str) -> Reader:
    """Return a reader of one of some words."""

    def read(value: Any) -> str:
        if value not in allowed:
            raise ValueError(" or ".join(allowed))
        return str(value)

    return read


def whole(low: int, high: int) -> Reader:
    """Return a reader of whole numbers between two bounds, both allowed."""

    def read(value: Any) -> int:
        fits = isinstance(value, int) or (isinstance(value, float) and value.is_integer())
        fits = fits and not isinstance(value, bool)
        if not fits or not low <= value <= high:
            raise ValueError(f"a whole number from {low} to {high}")
        return int(value)

    return read


def sentence(value: Any) -> str:
    """Read a prompt; what a model can read of it is checked where it is parsed."""
    if not isinstance(value, str) or not value.strip() or len(value) > LONGEST_SENTENCE or not is_printable(value):
        raise ValueError(f"a sentence of 1 to {LONGEST_SENTENCE} printable characters")
    return " ".join(value.split())


def switch(value: Any) -> bool:
    """Read true or false."""
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


def reference(value: Any) -> Any:
    """Read the name of another motion; in Python it may be the clip itself."""
    if value is None or value == "" or isinstance(value, bool | int | float | list | dict):
        raise ValueError("the name of a motion")
    return value


@dataclass(frozen=True)
class Parameter:
    """A parameter of an operation.

    Attributes:
        name: its key in JSON.
        about: what it means, with its default; a sentence.
        read: checks a value.
        default: the value if none is given; `REQUIRED` = one has to be given.
        option: its option of the command line, such as `--blend`, which acts on the operation before it; empty = it is
            part of the value of the operation's own option.
        metavar: placeholder of the option's value; empty = a flag.
    """

    name: str
    about: str
    read: Reader
    default: Any = REQUIRED
    option: str = ""
    metavar: str = ""


@dataclass(frozen=True)
class Operation:
    """An operation on motions.

    Attributes:
        name: `op` in JSON, and the option of the command line after `--`.
        about: help text; a sentence.
        run: `module:function` that computes it from a clip, the values of the parameters, and `load`, which reads
            other motions by name.
        parameters: in the order of the option's value, which separates them by colons.
        metavar: placeholder of the option's value; empty = a flag. Parts in brackets may be left out.
        keeps_cycle: the manifest's record of a loop still holds, or `run` has changed it.
        keeps_place: the result stands where the motion stood, however its first pose faces.
        keeps_rows: the rows of a timeline in the manifest still hold, or `run` has changed them.
        pieces: one motion becomes several; `marey.motion.edits.steps` writes them as other operations.
        needs_model: a model generates frames; `run` gets it as its third argument.
    """

    name: str
    about: str
    run: str
    parameters: tuple[Parameter, ...] = ()
    metavar: str = ""
    keeps_cycle: bool = False
    keeps_place: bool = False
    keeps_rows: bool = False
    pieces: bool = False
    needs_model: bool = False

    def function(self) -> Callable[..., Any]:
        """Import and return the function that computes the operation."""
        module, _, name = self.run.partition(":")
        return getattr(import_module(module), name)

    def values_of_text(self, text: str) -> Mapping[str, Any]:
        """Return the JSON values of the text after the option, such as `0.5:f60`; an empty part is not given."""
        own = [each for each in self.parameters if not each.option]
        parts = text.split(":") if len(own) > 1 else [text]
        if not ("[" in self.metavar and len(parts) < len(own)) and len(parts) != len(own):
            raise ValueError(self.metavar)
        return {
            each.name: part if each.read is reference else value_of_text(part)  # names of digits are names
            for each, part in zip(own, parts, strict=False)
            if part
        }


def value_of_text(text: str) -> float | str:
    """Return a number as a number, and any other text as it is."""
    try:
        return float(text)
    except ValueError:
        return text
