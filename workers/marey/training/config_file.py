"""Configurations as TOML files: a preset by name, and the fields that differ from it.

    preset = "paper"

    [train_masked]
    batch = 128

Types and ranges are those of the annotations of a model's configuration, so that a model, of Marey or of a plug-in,
needs no code for it. What fields mean is read from the comments in its source.
"""

from __future__ import annotations

import inspect
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast, get_args, get_origin, get_type_hints

from marey.core.configs import Between, ModelConfig
from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile, InvalidInput, MareyError
from marey.core.suggestions import nearest

C = TypeVar("C", bound=ModelConfig)
MAX_BYTES = 2**20
PRESET = "preset"
"""Key of the file that names the preset; all others are fields."""
_FIELD = re.compile(r"^    (\w+): [^#\n]*?(?:#\s*(.*))?$")


def open_config(named: Callable[..., C], given: str, choices: Mapping[str, str] | None = None) -> C:
    """Return a configuration by the name of a preset, or from a TOML file that changes a preset.

    A file's configuration has the file's name, unless it sets `name`.

    Args:
        named: `(name, **choices) -> configuration` of the model (`Training.config`).
        given: name, or a path that ends in `.toml`.
        choices: the model's own options on the command line; files set fields in their place.

    Raises:
        NotFound: there is no such file.
        InvalidFile: not TOML, an unknown field, a value of another type or out of range; says where.
        InvalidInput: an unknown preset, or options beside a file.
    """
    if not given.endswith(".toml"):
        return named(given, **(choices or {}))
    if choices:
        raise InvalidInput(f"cannot be used with {given}", where=f"--{next(iter(choices))}", hint="Set it in the file.")
    values = _parse(Path(given))
    base = _preset(named, values.pop(PRESET, None), given)
    try:
        config = _changed(base, {"name": Path(given).stem, **values}, given, "")
        config.check()
    except MareyError as error:
        if error.where and error.where.startswith(given):
            raise
        raise InvalidFile(error.message, where=_place(given, error.where or ""), hint=error.hint) from None
    return config


def preset_of(given: str) -> str:
    """Return the preset that a configuration inherits: the name itself, or the one that a file names.

    Raises:
        NotFound, InvalidFile: as `open_config`.
    """
    return _parse(Path(given)).get(PRESET, "") if given.endswith(".toml") else given


def _parse(path: Path) -> dict[str, Any]:
    data = read_bytes(path, limit=MAX_BYTES)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError:
        raise InvalidFile("is not UTF-8", where=str(path)) from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InvalidFile(f"is not TOML: {error}", where=str(path)) from None


def _preset(named: Callable[..., C], name: object, file: str) -> C:
    if not isinstance(name, str) or name.endswith(".toml"):
        raise InvalidFile(
            "names no preset to inherit from" if name is None else f"is {name!r}, not the name of a preset",
            where=_place(file, PRESET),
            hint=f'Begin the file with a line such as {PRESET} = "starter".',
        )
    try:
        return named(name)
    except InvalidInput as error:
        raise InvalidFile(error.message, where=_place(file, PRESET), hint=error.hint) from None


def _changed(config: Any, values: Mapping[str, Any], file: str, table: str) -> Any:
    """Return a dataclass with some fields changed, nested ones by their tables."""
    hints = get_type_hints(type(config), include_extras=True)
    known = [field.name for field in fields(config)]
    changed: dict[str, Any] = {}
    for name, value in values.items():
        path = f"{table}{name}"
        if name not in known:
            raise InvalidFile("is an unknown field", where=_place(file, path), hint=_near(name, known))
        own = getattr(config, name)
        if is_dataclass(own):
            if not isinstance(value, dict):
                raise InvalidFile(f"is {value!r}, not a table", where=_place(file, path), hint=f"Write [{path}].")
            changed[name] = _changed(own, cast("dict[str, Any]", value), file, f"{path}.")
        else:
            changed[name] = _typed(hints[name], value, _place(file, path))
    return replace(config, **changed)


def _typed(hint: Any, value: Any, where: str) -> Any:
    """Return a TOML value as a field of this type; a whole number may stand for a float.

    Raises:
        InvalidFile: another type, or out of range.
    """
    if get_origin(hint) is Annotated:
        kind, *marks = get_args(hint)
        found = _typed(kind, value, where)
        for mark in marks:
            if isinstance(mark, Between) and not mark.contains(found):
                raise InvalidFile(f"is {found}, not {mark}", where=where)
        return found
    if get_origin(hint) is Literal:
        if value in (allowed := get_args(hint)) and type(value) in {type(each) for each in allowed}:
            return value
    elif get_origin(hint) is tuple:
        return _tuple(get_args(hint), value, where)
    elif hint is float and type(value) is int:
        return float(value)
    elif type(value) is hint:
        return value
    raise InvalidFile(f"is {_shown(value)}, not {describe(hint)}", where=where)


def _tuple(kinds: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    every = kinds[-1] is Ellipsis
    if not isinstance(value, list) or (not every and len(cast("list[Any]", value)) != len(kinds)):
        raise InvalidFile(f"is {_shown(value)}, not {describe(tuple[kinds])}", where=where)
    values = cast("list[Any]", value)
    wanted = [kinds[0]] * len(values) if every else kinds
    return tuple(
        _typed(kind, each, f"{where}.{number}") for number, (kind, each) in enumerate(zip(wanted, values, strict=True))
    )


def _near(name: str, known: list[str]) -> str:
    near = nearest(name, known)
    return f"Did you mean {near}?" if near else f"Known: {', '.join(known)}."


def _place(file: str, path: str) -> str:
    return f"{file}: {path}" if path else file


def _shown(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def describe(hint: Any) -> str:
    """Return what a field takes, for messages and documents: `a whole number, at least 1`, `"hard" or "random"`."""
    if get_origin(hint) is Annotated:
        kind, *marks = get_args(hint)
        return ", ".join([describe(kind), *(str(mark) for mark in marks)])
    if get_origin(hint) is Literal:
        return " or ".join(_toml(each) for each in get_args(hint))
    if get_origin(hint) is tuple:
        kinds = get_args(hint)
        return (
            f"a list, each {describe(kinds[0])}"
            if kinds[-1] is Ellipsis
            else (f"a list of {len(kinds)}, each {describe(kinds[0])}")
        )
    return {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}[hint]


@dataclass(frozen=True)
class Field:
    """A field that a file may set."""

    path: str  # with its tables: `train_masked.batch`
    takes: str  # type and range
    value: Any
    about: str  # the comment in the source; empty if there is none


def list_fields(config: ModelConfig) -> tuple[Field, ...]:
    """Return every field of a configuration, those of tables behind the others."""
    return tuple(_fields(config, ""))


def _fields(config: Any, table: str) -> Iterator[Field]:
    hints, about = get_type_hints(type(config), include_extras=True), _comments(type(config))
    own = [(field.name, getattr(config, field.name)) for field in fields(config)]
    for name, value in own:
        if not is_dataclass(value):
            yield Field(f"{table}{name}", describe(hints[name]), value, about.get(name, ""))
    for name, value in own:
        if is_dataclass(value):
            yield from _fields(value, f"{table}{name}.")


def _comments(kind: type) -> dict[str, str]:
    """Return the comment behind each field of a dataclass, or the text below it."""
    try:
        lines = inspect.getsource(kind).splitlines()
    except (OSError, TypeError):
        return {}
    found: dict[str, str] = {}
    for number, line in enumerate(lines):
        if not (match := _FIELD.match(line)):
            continue
        text = match[2] or ""
        below = "\n".join(lines[number + 1 :]).lstrip()
        if not text and below.startswith('"""'):
            text = below[3:].partition('"""')[0]
        found[match[1]] = " ".join(text.split())
    return found


def write_toml(config: ModelConfig, preset: str) -> str:
    """Return a file with every field of a configuration, what it takes and what it means, to change and train with."""
    lines = [f"{PRESET} = {_toml(preset)}"]
    table = ""
    for field in list_fields(config):
        *tables, name = field.path.split(".")
        if name == "name" and not tables:
            continue  # the file's
        if (own := ".".join(tables)) != table:
            table = own
            lines += ["", f"[{table}]"]
        lines.append(
            f"{name} = {_toml(field.value)}  # {'; '.join(filter(None, (field.about.rstrip('.'), field.takes)))}"
        )
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    """Return a value of a field as TOML."""
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(each) for each in cast('tuple[Any, ...]', value))}]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return _shown(value)
