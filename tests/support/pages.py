"""Commands in the documentation: code blocks marked `console`, in README, project files, docs and model cards."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("models/*/README.md")])
RUN = "<!-- run -->"
"""Stands before a block that a test runs; the others are checked against the real command line."""
_BLOCK = re.compile(rf"({re.escape(RUN)}\n)?^ *```console\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
_PROMPT = re.compile(r"^ *[$#] (?=\S)")


@dataclass(frozen=True)
class Block:
    """A block of commands.

    Attributes:
        page: path from the root of the repository.
        line: of its first command, in the page.
        text: as it stands.
        runs: a test runs it.
    """

    page: str
    line: int
    text: str
    runs: bool

    @property
    def script(self) -> str:
        """Input of a shell: lines with a prompt and their continuations, without the prompt and without output.

        A block in which no line has the prompt `$` is typed as root, with the prompt `#`.
        """
        prompt = "$" if re.search(r"^ *\$ ", self.text, re.MULTILINE) else "#"
        lines, going = [], False
        for line in self.text.splitlines():
            if line.lstrip().startswith(f"{prompt} ") or going:
                lines.append(line if going else _PROMPT.sub("", line))
                going = lines[-1].split(" #")[0].rstrip().endswith("\\")
        return "\n".join(lines)

    def commands(self) -> Iterator[list[str]]:
        """The words of each simple command."""
        for line in self.script.replace("\\\n", " ").splitlines():
            lexer = shlex.shlex(line, posix=True, punctuation_chars="&|;()")
            lexer.whitespace_split = True
            words: list[str] = []
            for word in lexer:
                if word.strip("&|;()"):
                    words.append(word)
                elif words:
                    yield words
                    words = []
            if words:
                yield words


def blocks(pages: list[Path] = PAGES) -> list[Block]:
    """All blocks of commands of the pages."""
    found = []
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for match in _BLOCK.finditer(text):
            line = text[: match.start(2)].count("\n") + 1
            found.append(Block(page.relative_to(ROOT).as_posix(), line, match[2], match[1] is not None))
    return found
