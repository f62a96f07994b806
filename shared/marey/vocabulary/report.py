"""Report on the scope of many prompts: counts, the first examples, and warnings in words. Bounded, whatever is read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, get_args

from marey.vocabulary.lengths import stated_length
from marey.vocabulary.scope import ActionLists, Scope, Verdict, match_scope, scope_of_rows

MAX_EXAMPLES = 3
"""Of each verdict and flag."""
MAX_PLACES = 10
"""Places of prompts that a warning names."""
MAX_SHOWN = 60
"""Characters of a prompt in a message."""
MAX_NAMED = 20
"""Actions that a message names."""
MAX_LEFT = 64
"""Undecided prompts that a report keeps: as many as the text service judges at a time."""
MAX_BUNDLES = 3
"""Bundles whose actions a message names."""

PART, RANGE = "length of a part", "length out of range"
"""Notes on the two reasons of the flag `length`."""

NOTES = {
    "tried": "named actions are unreliable with this model",
    "close": "read as another action",
    "negation": "what is not to be done may be done",
    "objects": "objects are mimed",
    "counts": "may be done another number of times",
    PART: "a stated length is that of a part of the motion: it is used only if the parts are made one by one",
    RANGE: "a stated length is not used: it is out of the model's range",
    "several-people": "one person is shown",
    "subject": "its subject is read as a person",
    "other-language": "words in another language are not read: write in English",
    "other-subject": "a person is shown in place of its subject",
}
"""Expectation for prompts of a verdict or with a flag; the flags that are not here come with `unknown`."""
REASONS = frozenset({"other-language", "other-subject"})
"""Flags that say why a prompt is `unknown`: they are told of beside it."""


@dataclass(frozen=True)
class ScopeExample:
    """One of the first prompts of a verdict or with a flag.

    Attributes:
        kind: the verdict or the flag.
        index: place of the prompt in the input, from 0.
        prompt: its first characters.
        actions: actions that make it so; of `close`, what they are read as.
    """

    kind: str
    index: int
    prompt: str
    actions: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return the fields."""
        return {"kind": self.kind, "index": self.index, "prompt": self.prompt, "actions": list(self.actions)}


@dataclass
class ScopeReport:
    """Scopes of the prompts of one input, by words, and by the encoder where its verdicts are given.

    Attributes:
        total: prompts.
        counts: prompts of each verdict.
        flags: prompts with each flag.
        unlisted: prompts for bundles that list no actions; they have no verdict.
        known: actions that each bundle knows which got an `unknown` prompt.
        decided: the encoder's verdicts, by bundle and prompt.
        left: the first prompts that the words leave undecided and that have no such verdict, by bundle.
    """

    total: int = 0
    counts: Counter[str] = field(default_factory=Counter[str])
    flags: Counter[str] = field(default_factory=Counter[str])
    unlisted: int = 0
    known: dict[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    decided: Mapping[tuple[str, str], Scope] = field(default_factory=dict[tuple[str, str], Scope])
    left: dict[str, list[str]] = field(default_factory=dict[str, list[str]])
    _noted: Counter[str] = field(default_factory=Counter[str])
    """Prompts with each flag that warnings tell of, by its note: those of `unknown` prompts only where they are its
    reason."""
    _places: dict[str, list[int]] = field(default_factory=dict[str, list[int]])
    """Places of the first prompts of each note, from 0 as in `JOB:INDEX`."""
    _examples: dict[str, list[ScopeExample]] = field(default_factory=dict[str, list[ScopeExample]])

    def judge(
        self,
        prompt: str,
        bundle: str,
        lists: ActionLists | None,
        *,
        lengths: tuple[float, float] | None = None,
        rows: Sequence[tuple[str | None, str]] = (),
    ) -> Scope | None:
        """Return the scope of the next prompt, and count it.

        Args:
            prompt: as `check_prompt` returns it.
            bundle: name of the bundle that will read it.
            lists: actions of the bundle; None = it lists none, and the prompt has no scope.
            lengths: shortest and longest length in words that the bundle uses, in seconds; None = not examined.
            rows: of a timeline (`marey.items.timeline.prompts_with_rows`): they are judged together, as one prompt.
        """
        index, self.total = self.total, self.total + 1
        if lists is None:
            self.unlisted += 1
            return None
        named = [(text if row is None else f"{row}: {text}", text) for row, text in rows or [(None, prompt)]]
        parts = [(shown, self._scope(text, bundle, lists)) for shown, text in named]
        scope = scope_of_rows([part for _, part in parts]) if rows else parts[0][1]
        if lengths is not None and not rows:
            scope = with_length(scope, prompt, lengths)
            parts = [(prompt, scope)]
        self._count(scope, parts, index, bundle, lists)
        return scope

    def _scope(self, prompt: str, bundle: str, lists: ActionLists) -> Scope:
        scope = self.decided.get((bundle, prompt)) or match_scope(prompt, lists)
        if scope.left is not None:
            self._leave(bundle, prompt)
        return scope

    def _count(
        self, scope: Scope, parts: Sequence[tuple[str, Scope]], index: int, bundle: str, lists: ActionLists
    ) -> None:
        """Count the scope of one input.

        Args:
            parts: text and scope of its prompts.
        """
        verdict = scope.verdict
        self.counts[verdict] += 1
        if verdict == "unknown" and len(self.known) < MAX_BUNDLES:
            self.known[bundle] = lists.known
        if verdict != "known":
            self._add(verdict, index, *next(part for part in parts if part[1].verdict == verdict))
        for flag in scope.flags:
            self.flags[flag] += 1
            if verdict != "unknown" or flag in REASONS:
                prompt, part = next(part for part in parts if flag in part[1].flags)
                note = _note_of(flag, prompt)
                self._noted[note] += 1
                self._add(flag, index, prompt, part, note)

    def _leave(self, bundle: str, prompt: str) -> None:
        if sum(map(len, self.left.values())) < MAX_LEFT and prompt not in self.left.get(bundle, ()):
            self.left.setdefault(bundle, []).append(prompt)

    def _add(self, kind: str, index: int, prompt: str, scope: Scope, note: str | None = None) -> None:
        """Note an example.

        Args:
            kind: the verdict or the flag.
            note: key of `NOTES`; None = `kind`.
        """
        note = note or kind
        places = self._places.setdefault(note, [])
        if len(places) < MAX_PLACES:
            places.append(index)
        examples = self._examples.setdefault(note, [])
        if len(examples) < MAX_EXAMPLES:
            named = (each for each in scope.actions if each.verdict == kind)
            actions = tuple(action for each in named if (action := each.read_as or each.action) is not None)
            examples.append(ScopeExample(kind, index, _cut(prompt), actions))

    def as_json(self) -> dict[str, Any]:
        """Return the report as the API answers it."""
        return {
            "by": "encoder" if self.decided and not self.left else "words",
            **{verdict: self.counts[verdict] for verdict in get_args(Verdict)},
            "unlisted": self.unlisted,
            "flags": dict(self.flags),
            "examples": [each.as_json() for examples in self._examples.values() for each in examples],
            "actions": {bundle: list(names) for bundle, names in self.known.items()},
        }

    def warnings(self) -> list[str]:
        """Return what a person has to know, in sentences; none for prompts that are known and have no flag."""
        found: list[str] = []
        if self.counts["unknown"]:
            knows = " ".join(says_known(bundle, names) for bundle, names in self.known.items())
            found.append(
                f"{self._subject('unknown')}: no action that the model knows; the motion is arbitrary. {knows}"
            )
        found += [f"{self._subject(kind)}: {note}" for kind, note in NOTES.items() if kind in self._examples]
        return found

    def _subject(self, kind: str) -> str:
        """Return the prompts of a verdict or with a flag: the only one, or their count, the places of the first ones
        and the words of the first."""
        first = self._examples[kind][0]
        what = f" ({', '.join(first.actions)})" if first.actions else ""
        if self.total == 1:
            return f"{first.prompt!r}{what}"
        count = self.counts[kind] or self._noted[kind]
        if count == 1:
            return f"1 of {self.total} prompts, index {first.index} (from 0), {first.prompt!r}{what}"
        places = ", ".join(map(str, self._places[kind])) + (", …" if count > MAX_PLACES else "")
        return f"{count} of {self.total} prompts, indexes {places} (from 0), first {first.prompt!r}{what}"


def _note_of(flag: str, prompt: str) -> str:
    """Return the key in `NOTES` of a flag of a prompt."""
    if flag != "length":
        return flag
    return PART if stated_length(prompt).is_partial else RANGE


def with_length(scope: Scope, prompt: str, lengths: tuple[float, float]) -> Scope:
    """Return a scope with the flag `length` if its prompt states a length that a bundle does not use.

    Args:
        scope: of the prompt.
        prompt: as `check_prompt` returns it.
        lengths: shortest and longest length in words that the bundle uses, in seconds.
    """
    stated = stated_length(prompt)
    exceeds = stated.within(*lengths) != stated.seconds
    return replace(scope, flags=(*scope.flags, "length")) if exceeds else scope


def warn_of(prompt: str, bundle: str, lists: ActionLists | None) -> list[str]:
    """Return the warnings of one prompt, by its words; none for a bundle that lists no actions."""
    report = ScopeReport()
    report.judge(prompt, bundle, lists)
    return report.warnings()


def says_known(bundle: str, actions: Sequence[str]) -> str:
    """Return a sentence with the actions that a bundle knows, the first ones if they are many."""
    shown = ", ".join(name.replace("-", " ") for name in actions[:MAX_NAMED])
    more = len(actions) - MAX_NAMED
    rest = f" and {more} more (`marey models show {bundle}`)" if more > 0 else ""
    return f"{bundle} knows: {shown or 'no action'}{rest}."


def refusal(scope: Scope) -> str | None:
    """Return the message about a prompt that is refused; None if nothing in it is `unknown`."""
    if scope.verdict != "unknown":
        return None
    unknown = ", ".join(repr(_cut(each.text)) for each in scope.actions if each.verdict == "unknown")
    why = f" ({', '.join(scope.flags)})" if scope.flags else ""
    return f"names an action that the model does not know: {unknown}{why}"


def _cut(text: str) -> str:
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 1]}…"
