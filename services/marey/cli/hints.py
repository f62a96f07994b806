"""Hints of the command line for errors of the client, which name arguments of the Python API."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from marey.core.errors import MareyError, TimedOut
from marey.items.problems import InvalidItems

OPTIONS = {
    "best_of": "--best-of",
    "body": "--body",
    "bundle": "--bundle",
    "bvh_root": "--bvh-root",
    "extra_columns": "--extra-columns",
    "file_format": "--input-format",
    "formats": "--format",
    "fps": "--fps",
    "in_place": "--in-place",
    "licence": "--licence",
    "mesh": "--mesh",
    "model": "--model",
    "name": "--name",
    "name_template": "--name-template",
    "overwrite": "--overwrite",
    "placement": "--placement",
    "redraws": "--redraws",
    "rest_pose": "--rest-pose",
    "rig": "--rig",
    "rig_map": "--map",
    "root_bone": "--root-bone",
    "seconds": "--seconds",
    "seed": "--seed",
    "settings": "--set",
    "tags": "--tag",
    "text_encoder": "--text-encoder",
    "tpose_frame": "--tpose-frame",
    "variants": "--variants",
}
"""The option of each argument that an error may name."""
NO_OPTIONS: Mapping[str, str] = MappingProxyType({})
_FIELD = re.compile(r"([a-z][a-z_]*)(\.[0-9]+)?")
"""A field of a request, or an element of one that is a list."""
_OPERATION = re.compile(r"^ops\.([0-9]{1,3})\b")


def name_options(error: MareyError, given: Mapping[str, str] = NO_OPTIONS, words: Iterable[str] = ()) -> MareyError:
    """Let an error name the option of the command line in place of the argument of the Python API or of the field of a
    request.

    Args:
        given: options and arguments of the command, by the names of fields and arguments.
        words: the command line. An error about a file of it, such as `-o loop`, is about no field.
    """
    argument = error.argument
    if argument is None and error.where in set(_paths(words)):
        return error
    if argument is None or argument not in (OPTIONS.keys() | given.keys()):
        return _name_fields(error, given)
    option = given.get(argument) or OPTIONS[argument]
    if error.where == argument:
        error.where = option
    if error.hint is not None and option not in error.hint:
        error.hint = re.sub(rf"pass {argument}=True|\b{argument}\b", lambda found: _named(found, option), error.hint)
    return error


def _paths(words: Iterable[str]) -> Iterator[str]:
    """Yield the paths that the values of a command line may be, and the folders above each."""
    for word in words:
        value = word.partition("=")[2] if word.startswith("--") else word[2:] if word.startswith("-") else word
        yield from map(str, (Path(value), *Path(value).parents))


def _name_fields(error: MareyError, given: Mapping[str, str]) -> MareyError:
    """Let an error of the server, which names fields of its request, name the options that they are from."""
    error.where = _option_of(error.where, given)
    if isinstance(error, InvalidItems):
        error.problems = tuple(
            each if each.line is not None else replace(each, field=_option_of(each.field, given))
            for each in error.problems
        )
    return error


def _option_of(field: str | None, given: Mapping[str, str]) -> str | None:
    found = None if field is None else _FIELD.fullmatch(field)
    if found is None:
        return field
    option = OPTIONS.get(found[1])
    return given.get(found[1]) or (option if option in given.values() else field)


def name_operation(where: str) -> str:
    """Name an operation of an edit by its number, from 1, in the place of an item's error: `operation 1 (trim)`."""
    return _OPERATION.sub(lambda found: f"operation {int(found[1]) + 1}", where)


@contextmanager
def hint_of_timeout(hint: str) -> Generator[None]:
    """Give the error of a time limit that passes in the block this hint."""
    try:
        yield
    except TimedOut as error:
        error.hint = hint
        raise


def _named(found: re.Match[str], option: str) -> str:
    return f"use {option}" if found.group().startswith("pass ") else option
