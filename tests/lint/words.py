"""Check of the words in code: `python -m tests.lint.words`.

A docstring begins with an imperative or a noun phrase. Names and words that were replaced by standard ones
do not come back. Only Python files that git tracks are read.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

SKIPPED = (
    "migrations/",
    "services/marey/cli/",
    "services/marey/client/",
    "shared/marey/generation/",
    "tests/integration/test_live_loop.py",
    "tests/plugins/",
    "workers/marey/generation/",
    "workers/marey/models/",
)
"""Folders that are not checked yet."""

FIRST_WORDS = ("Whether", "What", "Nothing", "Who", "Whoever", "Whose")

NAMES = {
    "Room": "SessionPool, QuotaHeadroom",
    "Show": "LiveModel",
    "ShowFactory": "LiveModelFactory",
    "create_show": "create_live_model",
    "Keeper": "StreamSupervisor",
    "Over": "StreamFinished",
    "Held": "LeasedStream, LeasedItems",
    "HeldItem": "LeasedItem",
    "Begun": "ActionStart",
    "ReadAs": "PromptRewrite",
    "Bell": "StreamNotifier",
    "ring": "notify",
    "rang": "poll",
    "Watch": "ViewerPresence",
    "touch": "refresh",
    "let_in": "accept_connection",
    "Visit": "SessionRequest",
    "Wire": "SocketWriter",
    "tell": "send_message, enqueue_event",
    "complain": "send_error",
    "Brake": "BackpressurePause",
    "Lag": "LagTracker",
    "Tailer": "EventBroadcaster",
    "Teller": "StatusReporter",
    "admit": "acquire_slot, authorize",
    "dismiss": "release_slot",
    "Work": "ClaimTelemetry",
    "Offer": "GeneratorCapabilities",
    "Offers": "GeneratorList",
    "settled": "resolve_length",
    "described": "describe_settings",
    "several": "multimodality",
    "apart": "compositional",
    "Side": "EmbeddedSet",
    "Beat": "ProgressCallback",
    "unheard": "no_progress",
    "practise": "self_train",
    "Told": "HumanCaptions",
    "told": "normalize_clause",
    "take_apart": "unpack",
    "enter": "in_proj",
    "leave": "out_proj",
    "lower": "prepare_inference",
    "Configuration": "Settings",
    "Answer": "HeartbeatReply",
}
"""Names of classes and functions that were replaced, and the standard ones. Methods of other libraries that
are called so are no definitions, and pass."""

MODULES = {
    "bell": "notifier",
    "watch": "presence",
    "door": "accept",
    "wire": "socket_writer",
    "slow": "backpressure",
    "keeper": "supervisor",
    "held": "leased",
    "told": "captions",
    "tailer": "broadcaster",
    "offers": "generators",
    "body_room": "body_budget",
    "practice": "self_training",
}

WORDS = {
    r"tailers?": "broadcaster",
    r"tellers?": "status reporter",
    r"obedience": "prompt adherence, action accuracy",
    r"unheard": "no_progress",
    r"nought": "0, zero",
    r"whoever": "the client, the worker",
    r"whomever": "the client, the worker",
    r"nobody": "no client, no worker",
    r"somebody": "a client, another worker",
    r"in company": "in a batch",
    r"good-bye": "stop",
}
"""Words of docstrings and comments that were replaced (regular expressions), and the standard ones."""

_WORD = re.compile(r"\b(" + "|".join(WORDS) + r")\b", re.IGNORECASE)


@dataclass(frozen=True)
class Finding:
    """A word that has a standard replacement."""

    path: Path
    line: int
    message: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.message}"


def check_source(source: str, path: Path) -> list[Finding]:
    """Return the findings of one file, by line."""
    tree = ast.parse(source)
    found = [*_check_docstrings(tree, path), *_check_names(tree, path), *_check_comments(source, path)]
    if path.stem in MODULES:
        found.append(Finding(path, 1, f"module {path.stem!r}: use {MODULES[path.stem]!r}"))
    return sorted(found, key=lambda finding: finding.line)


def _docstrings(tree: ast.Module) -> Iterator[ast.Constant]:
    """Yield docstrings of modules, classes, functions, and of the attributes that they follow."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        for index, statement in enumerate(node.body):
            if not isinstance(statement, ast.Expr) or not isinstance(statement.value, ast.Constant):
                continue
            after_name = index > 0 and isinstance(node.body[index - 1], ast.Assign | ast.AnnAssign)
            if isinstance(statement.value.value, str) and (index == 0 or after_name):
                yield statement.value


def _check_docstrings(tree: ast.Module, path: Path) -> Iterator[Finding]:
    for node in _docstrings(tree):
        text = str(node.value).strip()
        first = re.match(r"\w+", text)
        if first and first.group() in FIRST_WORDS:
            message = f"docstring begins with {first.group()!r}: begin with an imperative or a noun phrase"
            yield Finding(path, node.lineno, message)
        for word in _WORD.finditer(text):
            yield Finding(path, node.lineno + text.count("\n", 0, word.start()), _replaced(word.group()))


def _check_names(tree: ast.Module, path: Path) -> Iterator[Finding]:
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            names = [node.name]
        elif isinstance(node, ast.ImportFrom | ast.Import):
            names = [alias.asname for alias in node.names if alias.asname]
        for name in names:
            if name in NAMES:
                yield Finding(path, getattr(node, "lineno", 1), f"name {name!r}: use {NAMES[name]}")


def _check_comments(source: str, path: Path) -> Iterator[Finding]:
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            for word in _WORD.finditer(token.string):
                yield Finding(path, token.start[0], _replaced(word.group()))


def _replaced(word: str) -> str:
    standard = next(new for old, new in WORDS.items() if re.fullmatch(old, word, re.IGNORECASE))
    return f"word {word!r}: use {standard}"


def tracked_files(root: Path = ROOT) -> list[Path]:
    """List the Python files that git tracks and that are checked, relative to the root."""
    listing = subprocess.run(["git", "ls-files", "*.py"], cwd=root, capture_output=True, text=True, check=True)
    paths = listing.stdout.splitlines()
    return [Path(path) for path in paths if not path.startswith(SKIPPED) and (root / path).is_file()]


def main() -> int:
    """Print the findings of all checked files; return 1 if there are any."""
    findings = [f for path in tracked_files() for f in check_source((ROOT / path).read_text(), path)]
    for finding in findings:
        print(finding)
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
