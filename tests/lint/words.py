"""Check of the words in code and documents: `python -m tests.lint.words`.

A docstring begins with an imperative or a noun phrase. Names and words that were replaced by standard ones
do not come back: in names, comments, docstrings, messages and Markdown. One class name has one meaning. Only
files that git tracks are read.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

SKIPPED: tuple[str, ...] = ()
"""Folders that are not checked yet."""

DIARY = "docs/research/"
"""Records of past work: dated reports, and a log that quotes old names. Their words are not checked."""

OTHER_NAMES = ("tests/", "benchmarks/", "services/marey/client/types/")
"""Folders whose class names are their own: the client's types mirror those of the API."""

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
    "Reading": "PromptParsing",
    "Opening": "StartingStream",
    "Made": "BundleFacts",
    "Asked": "ParsedEvaluation",
    "Patience": "BodyDeadline",
    "Messages": "ControlMessages",
    "Control": "StreamControl, GenerationControl",
    "offer": "capabilities",
    "offers": "list_generators",
    "obey": "forward, apply",
    "heard": "received",
    "_told": "a verb: _describe, _as_line",
    "ExpectedAct": "ExpectedAction",
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
    "reading": "parsing",
}

ONE_CONCEPT = {
    "ConditionConfig",
    "Decoder",
    "Encoder",
    "Frame",
    "Generated",
    "Generator",
    "InferenceConfig",
    "Items",
    "LengthEstimator",
    "MaskedTransformer",
    "Networks",
    "ResidualTransformer",
    "SamplingSettings",
    "Tokenizer",
    "TokenizerConfig",
    "TransformerConfig",
}
"""Class names with one meaning in several places: each model has its own, some with a protocol. `Frame` is the field's
word in both places: a pose of a motion, and a predicate with its roles (PropBank)."""

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
    r"allotments?": "quota",
    r"parted": "split",
    r"tak(?:e|en|es|ing) apart": "split, unpack",
    r"(?:an|one|two|three|several|each|single|these|those) acts?": "action",
}
"""Words that were replaced (regular expressions), and the standard ones."""

PHRASES = {
    r"is no (?!longer|more|less|better|worse)\w+ of": "unknown …, not a …",
    r"may not be told": "the cause, and how to allow it",
}
"""Turns of messages that were replaced, and the standard ones."""

_WORD = re.compile(r"\b(" + "|".join(WORDS) + r")\b", re.IGNORECASE)
_PHRASE = re.compile(r"\b(" + "|".join([*WORDS, *PHRASES]) + r")\b", re.IGNORECASE)

_LOGGING = {"debug", "info", "warning", "error", "exception", "critical"}
_TEXTS = {"hint", "help", "description", "message", "public", "reason", "epilog", "short_help"}
"""Keywords of calls whose strings users read."""

_CODE = re.compile(r"(`+)(.*?)\1", re.DOTALL)
_FENCE = re.compile(r"^( *)(```+|~~~+).*?^\1\2 *$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\([^)]*\)")


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
    nodes = list(ast.walk(ast.parse(source)))
    found = [*_check_docstrings(nodes, path), *_check_names(nodes, path), *_check_comments(source, path)]
    if not path.is_relative_to("tests"):
        found += _check_messages(nodes, path)
    if path.stem in MODULES:
        found.append(Finding(path, 1, f"module {path.stem!r}: use {MODULES[path.stem]!r}"))
    return sorted(found, key=lambda finding: finding.line)


def _docstrings(nodes: Sequence[ast.AST]) -> Iterator[ast.Constant]:
    """Yield docstrings of modules, classes, functions, and of the attributes that they follow."""
    for node in nodes:
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        for index, statement in enumerate(node.body):
            if not isinstance(statement, ast.Expr) or not isinstance(statement.value, ast.Constant):
                continue
            after_name = index > 0 and isinstance(node.body[index - 1], ast.Assign | ast.AnnAssign)
            if isinstance(statement.value.value, str) and (index == 0 or after_name):
                yield statement.value


def _check_docstrings(nodes: Sequence[ast.AST], path: Path) -> Iterator[Finding]:
    for node in _docstrings(nodes):
        text = str(node.value).strip()
        first = re.match(r"\w+", text)
        if first and first.group() in FIRST_WORDS:
            message = f"docstring begins with {first.group()!r}: begin with an imperative or a noun phrase"
            yield Finding(path, node.lineno, message)
        for word in _WORD.finditer(text):
            yield Finding(path, node.lineno + text.count("\n", 0, word.start()), _replaced(word.group()))


def _check_names(nodes: Sequence[ast.AST], path: Path) -> Iterator[Finding]:
    for node in nodes:
        names: list[str] = []
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            names = [node.name]
        elif isinstance(node, ast.ImportFrom | ast.Import):
            names = [alias.asname for alias in node.names if alias.asname]
        for name in names:
            if name in NAMES:
                yield Finding(path, getattr(node, "lineno", 1), f"name {name!r}: use {NAMES[name]}")


def _check_comments(source: str, path: Path) -> Iterator[Finding]:
    if not any(_WORD.search(line) for line in source.splitlines() if "#" in line):
        return  # most files: reading their tokens takes longer than all else
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            for word in _WORD.finditer(token.string):
                yield Finding(path, token.start[0], _replaced(word.group()))


def _check_messages(nodes: Sequence[ast.AST], path: Path) -> Iterator[Finding]:
    """Check strings that users read: of errors, log lines, options and fields."""
    lines: dict[tuple[int, int], ast.Constant] = {}
    for node in nodes:
        for text in _read_by_users(node):
            for part in ast.walk(text):
                if isinstance(part, ast.Constant) and isinstance(part.value, str):
                    lines[part.lineno, part.col_offset] = part
    for (line, _), part in sorted(lines.items()):
        for word in _PHRASE.finditer(str(part.value)):
            yield Finding(path, line, _replaced(word.group()))


def _read_by_users(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the expressions of a node whose strings users read."""
    if isinstance(node, ast.Raise) and node.exc is not None:
        yield node.exc
    elif isinstance(node, ast.Call):
        if isinstance(node.func, ast.Attribute) and node.func.attr in _LOGGING:
            yield from node.args
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        if name[:1].isupper():  # an error that is made here and raised elsewhere, an option, a metric
            yield from node.args
        yield from (keyword.value for keyword in node.keywords if keyword.arg in _TEXTS)


def check_markdown(text: str, path: Path) -> list[Finding]:
    """Return the findings of one document, by line: its prose, and replaced class names in its code."""

    def blank(found: re.Match[str]) -> str:
        return re.sub(r"[^\n]", " ", found.group())

    text = _FENCE.sub(blank, text)
    found = [(code.start(2), f"name {name!r}: use {NAMES[name]}") for code, name in _names_in_code(text)]
    prose = _LINK.sub(blank, _CODE.sub(blank, text))
    found += [(word.start(), _replaced(word.group())) for word in _WORD.finditer(prose)]
    if re.search(r"\bacts?\b", path.stem.replace("-", " ")):
        found.append((0, "file name: use 'action'"))
    return [Finding(path, text.count("\n", 0, place) + 1, message) for place, message in sorted(found)]


def _names_in_code(text: str) -> Iterator[tuple[re.Match[str], str]]:
    for code in _CODE.finditer(text):
        name = code[2].strip("()").rpartition(".")[2]
        if name in NAMES and re.search(r"[a-z][A-Z]|[a-z]_[a-z]", name):
            yield code, name


def check_meanings(sources: Mapping[Path, str]) -> list[Finding]:
    """Return the class names that several product files define, unless they are one concept (`ONE_CONCEPT`)."""
    defined: dict[str, list[tuple[Path, int]]] = defaultdict(list)
    for path, source in sources.items():
        if not str(path).startswith(OTHER_NAMES):
            for node in ast.walk(ast.parse(source)):
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    defined[node.name].append((path, node.lineno))
    return [
        Finding(path, line, f"class {name!r} exists in {others[0][0]}: name their difference")
        for name, others in sorted(defined.items())
        if name not in ONE_CONCEPT
        for path, line in others[1:]
    ]


def _replaced(word: str) -> str:
    known = {**WORDS, **PHRASES}
    standard = next(new for old, new in known.items() if re.fullmatch(old, word, re.IGNORECASE))
    return f"word {word!r}: use {standard}"


def tracked_files(root: Path = ROOT) -> list[Path]:
    """List the Python files that git tracks and that are checked, relative to the root."""
    return [path for path in _tracked("*.py", root) if not str(path).startswith(SKIPPED)]


def tracked_documents(root: Path = ROOT) -> list[Path]:
    """List the Markdown files that git tracks and that are checked, relative to the root."""
    return [path for path in _tracked("*.md", root) if not str(path).startswith(DIARY)]


def _tracked(pattern: str, root: Path) -> list[Path]:
    listing = subprocess.run(["git", "ls-files", pattern], cwd=root, capture_output=True, text=True, check=True)
    return [Path(path) for path in listing.stdout.splitlines() if (root / path).is_file()]


def findings_of_all() -> list[Finding]:
    """Return the findings of all checked files."""
    sources = {path: (ROOT / path).read_text("utf-8") for path in tracked_files()}
    found = [finding for path, source in sources.items() for finding in check_source(source, path)]
    for path in tracked_documents():
        found += check_markdown((ROOT / path).read_text("utf-8"), path)
    return [*found, *check_meanings(sources)]


def main() -> int:
    """Print the findings of all checked files; return 1 if there are any."""
    findings = findings_of_all()
    for finding in findings:
        print(finding)
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
