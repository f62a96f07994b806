"""Commands in the documents exist, with their arguments and options.

Blocks that follow `<!-- run -->` are run by tests/acceptance/served/test_first_day.py. The others would need captures
and hours (training), a deployment (containers, systemd, a proxy) or a job to work on; they are parsed by the real
command line, which checks commands, options, arguments and the kinds of values.
"""

from __future__ import annotations

import re
import subprocess
from functools import cache
from importlib.util import find_spec
from itertools import pairwise, takewhile
from typing import Any

import pytest
import typer

from marey.cli.main import app
from marey.data.dataset import known_sets
from marey.data.feature_sets import FEATURE_SETS
from tests.support.pages import ROOT, Block, blocks

ALL = blocks()
SYSTEM = {".", "cd", "cp", "cut", "docker", "export", "git", "head", "install", "od", "pip", "printf", "rm", "tr"}
SYSTEM |= {"base64", "curl", "systemctl", "tensorboard", "torchrun", "umask", "useradd"}
"""Programs that are not ours: a shell parses their lines, nothing more is checked."""
ENVIRONMENT = re.compile(r"[A-Z][A-Z0-9_]*=")
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


@cache
def command_line() -> Any:
    return typer.main.get_command(app)


def parse(command: Any, name: str, words: list[str], parent: Any = None) -> None:
    """Parse as the program does, and run nothing; raises what the program would print."""
    context = command.make_context(name, list(words), parent=parent)
    if hasattr(command, "commands"):
        name, child, rest = command.resolve_command(context, [*context._protected_args, *context.args])
        parse(child, name, rest, context)


def module_exists(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def unknown_source(words: list[str]) -> str | None:
    """The error of `marey data prepare` and `pack`, which read pairs of a source and its path before the options."""
    if words[:2] not in (["data", "prepare"], ["data", "pack"]):
        return None
    sources = set([*takewhile(lambda word: not word.startswith("-"), words[2:])][::2])
    unknown = sources - {"own", "pack", *known_sets(), *FEATURE_SETS}
    return f"no known set: {unknown}" if unknown else None


def file_as_prompt(words: list[str]) -> str | None:
    """The error of a prompt that is the name of a file: such a command lacks `-f`."""
    if words[0] not in ("submit", "generate"):
        return None
    positional = [word for before, word in pairwise(words) if not before.startswith("-")]
    return next((f"a file without -f: {word}" for word in positional if word.endswith((".csv", ".jsonl"))), None)


def check(words: list[str]) -> str | None:
    """The error of a command; None if it is right."""
    while ENVIRONMENT.match(words[0]) and len(words) > 1:
        words = words[1:]
    program = words[0].removeprefix(".venv/bin/")
    if program == "marey":
        try:
            parse(command_line(), "marey", words[1:])
        except typer.Exit:
            return None
        except Exception as error:  # the parser's own errors have no public base class
            return str(error)
        return unknown_source(words[1:]) or file_as_prompt(words[1:])
    if program == "make":
        targets = [word for word in words[1:] if "=" not in word and not word.startswith(("-", "/"))]
        return None if set(targets) <= TARGETS else f"no target of the Makefile: {targets}"
    if program in ("python", "python3") and words[1] == "-m":
        return None if module_exists(words[2]) else f"no module {words[2]}"
    if program in ("pytest", "uvx") or ENVIRONMENT.match(program):
        return None
    if program.startswith("deploy/"):
        return None if (ROOT / program).is_file() else "no such file"
    if program not in SYSTEM:
        return "not a known program: add it to SYSTEM, or mark the block as text"
    return None


@pytest.mark.parametrize("block", ALL, ids=lambda block: f"{block.page}:{block.line}")
def test_commands_exist_with_their_options(block: Block) -> None:
    wrong = {" ".join(words): problem for words in block.commands() if (problem := check(words))}
    assert wrong == {}


@pytest.mark.parametrize("page", sorted({block.page for block in ALL}))
def test_a_shell_can_parse_the_blocks(page: str) -> None:
    script = "\n".join(block.script for block in ALL if block.page == page)
    done = subprocess.run(["bash", "-n"], input=script, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_block_has_a_command() -> None:
    assert [f"{block.page}:{block.line}" for block in ALL if not list(block.commands())] == []


@pytest.mark.parametrize(
    "words",
    [
        ["marey", "submit", "-f", "a.csv", "--no-such-option"],
        ["marey", "no-such-command"],
        ["marey", "convert", "a.npz"],
        ["marey", "submit", "a.csv", "--model", "hgm3"],
        ["marey", "submit", "--seed", "x", "a person walks"],
        ["marey", "data", "prepare", "no-such-set", "set.zip", "-o", "prepared"],
        ["make", "no-such-target"],
        ["python", "-m", "marey.no_such_module"],
        ["frobnicate"],
    ],
)
def test_a_wrong_command_is_found(words: list[str]) -> None:
    assert check(words)
