"""`python -m marey.vocabulary.page FILE`: the reference page of all actions with their words.

FILE is docs/reference/vocabulary.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

from marey.vocabulary.entries import Action, Vocabulary, load_vocabulary

MOST_WORDS = 12
"""Words of an action that the page lists; the file has all."""

HEAD = """# Actions and their words

Written by `python -m marey.vocabulary.page docs/reference/vocabulary.md`; do not edit.

Which actions Marey knows by name, what each of them means, and words that ask for it. A prompt in
these words is recognised: `marey submit` and `marey generate` say whether the bundle can do its
actions ([scope](scope.md)), and most of them are checked in the finished motion
([match](quality.md#match)). **A bundle supports a part of them**: `marey models show hgm3-open` lists
which it supports, and which it only tried. Other prompts are generated too.

- Words are listed in their base form, verbs before nouns, at most {most} an action. Any form counts
  ("walks", "is walking"), and articles, sides, numbers and adverbs may stand beside them: "raises
  his left arm slowly" is *raise arm*. `~` stands for one to three words, `=` before a word for that
  form alone.
- Lengths are metres on a body of 1.75 m. "For most of the clip" is 60 % of it or more.
- All words, and those that are read as an action though its definition does not promise them
  (`near`), are in `shared/marey/vocabulary/vocabulary.toml`.

{count} actions:

| action | the body | words |
|---|---|---|
"""


def page_of(vocabulary: Vocabulary) -> str:
    """Return the page in Markdown: a row for each action, in the order of the file."""
    head = HEAD.format(most=MOST_WORDS, count=len(vocabulary.actions))
    return head + "".join(f"{_row(action)}\n" for action in vocabulary.actions.values())


def _row(action: Action) -> str:
    words = ", ".join([*action.verbs, *action.nouns][:MOST_WORDS])
    kind = f" A manner of `{action.kind_of}`." if action.kind_of else ""
    sides = f" Left and right name the {action.sided}." if action.sided else ""
    number = " Can be counted." if action.counted else ""
    definition = action.definition.removeprefix("The body ").replace("|", "\\|")
    return f"| `{action.id}` | {definition}{kind}{sides}{number} | {words} |"


def main(arguments: list[str]) -> int:
    """Write the page into the file that is named; return the exit code."""
    if len(arguments) != 1:
        sys.stderr.write("usage: python -m marey.vocabulary.page FILE\n")
        return 2
    Path(arguments[0]).write_text(page_of(load_vocabulary()), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
