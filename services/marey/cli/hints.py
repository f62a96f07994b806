"""Hints of the command line for errors of the client, which name arguments of the Python API."""

from __future__ import annotations

import re
from collections.abc import Generator
from contextlib import contextmanager

from marey.core.errors import MareyError, TimedOut

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
_OPERATION = re.compile(r"^ops\.([0-9]{1,3})\b")


def name_options(error: MareyError) -> MareyError:
    """Let an error name the option of the command line in place of the argument of the Python API."""
    argument = error.argument
    if argument is None or argument not in OPTIONS:
        return error
    option = OPTIONS[argument]
    if error.where == argument:
        error.where = option
    if error.hint is not None:
        error.hint = re.sub(rf"pass {argument}=True|\b{argument}\b", lambda found: _named(found, option), error.hint)
    return error


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
