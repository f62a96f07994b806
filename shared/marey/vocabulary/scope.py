"""Scope of a prompt by its words: which actions it names, and whether a bundle knows them.

No network and no labeller: `submit` runs this on every prompt, in the client and in the server. It sees words alone,
and says which prompts they leave undecided (`Scope.left`); `marey.text.meaning` decides those in the text stage.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal, get_args

from marey.vocabulary.bearing_words import BarePrompt, as_written
from marey.vocabulary.counts import stated_count
from marey.vocabulary.entries import Vocabulary, load_vocabulary
from marey.vocabulary.flags import Flag, Flagger
from marey.vocabulary.lengths import stated_length
from marey.vocabulary.lexicon import Lexicon, Meaning, words_of
from marey.vocabulary.movements import Movements
from marey.vocabulary.negation import Negations, Span, denies
from marey.vocabulary.phrase_roles import PhraseRoles
from marey.vocabulary.phrases import Match, PhraseFinder, Word
from marey.vocabulary.take_names import as_words
from marey.vocabulary.word_lists import load_word_lists

Verdict = Literal["known", "close", "tried", "unknown"]
"""`known`: the bundle supports the action; `close`: it is read as another that the bundle supports; `tried`: the bundle
was trained on it, with less than 80 % adherence; `unknown`: none of these."""
ScopePolicy = Literal["warn", "refuse", "ignore"]
"""Treatment of prompts with an unknown action: accepted with a warning, refused, or not examined."""
POLICIES: tuple[ScopePolicy, ...] = get_args(ScopePolicy)

Left = Literal["noun", "verb", "part"]
"""Kinds of prompts that the words leave undecided. `noun`: a noun that names an action may stand for a thing ("a bow");
`verb`: a person does something in a verb that is in no list; `part`: actions are named, but none in one of the clauses,
which may ask for a movement ("walks in, then hoists the sail")."""

VERSION = 1
STANDING = "idle"
"""Action of a body that only makes a gesture; said beside other actions, too: "stands and waves"."""
GESTURES = frozenset(
    {
        *("wave", "raise-arm", "clap", "cheer", "laugh", "nod", "signal", "guide", "shiver", "talk", "drink", "wash"),
        *("reach-up", "reach-forward", "aim", "shoot", "draw-bow", "cast-spell", "throw", "slash", "stab", "block"),
        *("bow", "twist", "arm-circles", "flinch", "punch"),
    }
)
"""Actions of arms, head and trunk: they are done in the posture in which the body is."""
MAX_TEXT = 200
"""Characters of a prompt that stand for the action of one that names none."""
KEPT_READINGS = 1024
"""Prompts whose words are kept as read: jobs, the text stage and manifests ask for the scope of the same ones."""
_OFF_FEET = ("seat", "whole-body")
"""Supports from which the body rises by different actions."""
_LEAST_SAID = 4
"""Words beside a negation from which on something may be done as well."""
_ORDER: dict[str, int] = {verdict: rank for rank, verdict in enumerate(get_args(Verdict))}


@dataclass(frozen=True)
class ActionLists:
    """The actions that a bundle's manifest lists, by id.

    Attributes:
        supported: at least 80 % adherence.
        single_take: supported, learned from fewer than four sources.
        tried: trained on, below 80 %.
        drawn: bearings (`marey.vocabulary.bearings`) are drawn on the bundle's motions. The `text` of a manifest says
            so, not its lists.
    """

    supported: tuple[str, ...]
    single_take: tuple[str, ...] = ()
    tried: tuple[str, ...] = ()
    drawn: bool = False

    @property
    def known(self) -> tuple[str, ...]:
        """Ids of all supported actions."""
        return (*self.supported, *self.single_take)

    def knows(self, name: str) -> bool:
        """Return True if the action is supported."""
        return name in self.supported or name in self.single_take


@dataclass(frozen=True)
class NamedAction:
    """One action that a prompt names.

    Attributes:
        text: the words for it, as the prompt has them; of a gait such as "limps", as they are read: "walks".
        verdict: see `Verdict`.
        action: id of the action in the vocabulary; None = in no entry, or a gesture of `bearings.toml`, which is known.
        read_as: id of the supported action that a `close` one is read as.
    """

    text: str
    verdict: Verdict
    action: str | None = None
    read_as: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the fields that say something."""
        values = {"text": self.text, "verdict": self.verdict, "action": self.action, "read_as": self.read_as}
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class Scope:
    """Scope of one prompt.

    Attributes:
        by: `words`, or `encoder` where the words left it undecided.
        left: what the words leave undecided; None = nothing, or the encoder has decided it.
        rows: of the prompts of a timeline or an edit, of which this is the scope together.
    """

    actions: tuple[NamedAction, ...]
    flags: tuple[Flag, ...] = ()
    by: Literal["words", "encoder"] = "words"
    left: Left | None = None
    rows: tuple[Scope, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of the prompt's actions."""
        return max((action.verdict for action in self.actions), key=_ORDER.__getitem__)

    def as_json(self) -> dict[str, Any]:
        """Return the record that items and manifests store."""
        return {
            "version": VERSION,
            "by": self.by,
            "verdict": self.verdict,
            "actions": [action.as_json() for action in self.actions],
            "flags": list(self.flags),
            **({"rows": [row.as_json() for row in self.rows]} if self.rows else {}),
        }


def read_scope(record: Mapping[str, Any]) -> Scope:
    """Return the scope that `Scope.as_json` wrote."""
    actions = (NamedAction(**action) for action in record["actions"])
    rows = tuple(map(read_scope, record.get("rows", ())))
    return Scope(tuple(actions), tuple(record["flags"]), by=record["by"], rows=rows)


def scope_of_rows(rows: Sequence[Scope]) -> Scope:
    """Return the scope of several prompts together."""
    actions = tuple(dict.fromkeys(action for row in rows for action in row.actions))
    flags: tuple[Flag, ...] = tuple(dict.fromkeys(flag for row in rows for flag in row.flags))
    by = "encoder" if any(row.by == "encoder" for row in rows) else "words"
    return Scope(actions, flags, by=by, left=next((row.left for row in rows if row.left), None), rows=tuple(rows))


def scope_of_prompts(prompts: Sequence[Scope]) -> Scope:
    """Return the scope of the prompts of an edit together: of one prompt it is its own."""
    return prompts[0] if len(prompts) == 1 else scope_of_rows(prompts)


@dataclass(frozen=True)
class _Phrase:
    """The words for one action, and what they may mean."""

    text: str
    meanings: tuple[Meaning, ...]


@dataclass(frozen=True)
class _Reading:
    """The words of a prompt as they are read, whatever a bundle supports.

    Attributes:
        phrases: that name its actions; none = it names none.
        flags: see `Scope`.
        left: what the words leave undecided, where a bundle knows the actions.
    """

    phrases: tuple[_Phrase, ...]
    flags: tuple[Flag, ...]
    left: Left | None


class ScopeMatcher:
    """Matches prompts against a vocabulary."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        """Build the tables, once."""
        lists = load_word_lists()
        lexicon = Lexicon(vocabulary, lists.other_verbs, lists.idioms, lists.asides)
        travels = frozenset(
            action.id for action in vocabulary.actions.values() if action.in_place and not action.kind_of
        )
        self._vocabulary, self._lists = vocabulary, lists
        self._phrases = PhraseFinder(lexicon, lists, travels)
        self._roles = PhraseRoles(lexicon, lists, vocabulary, travels)
        handling = frozenset(
            verb
            for action in vocabulary.actions.values()
            if action.support == "feet"  # what hands hold on to is a place
            for phrase in (*action.verbs, *action.near)
            for verb, *objects in [words_of(phrase)]
            if objects and objects[0] in lists.objects
        )
        self._movements = Movements(lists, vocabulary)
        self._negations = Negations(lexicon, lists)
        self._flagger = Flagger(lexicon, lists, travels, handling)
        self._read = lru_cache(maxsize=KEPT_READINGS)(self._read_words)

    def match(self, prompt: str, lists: ActionLists) -> Scope:
        """Return the scope of a prompt relative to what a bundle supports."""
        prompt = as_words(prompt)
        bare = BarePrompt.of(prompt) if lists.drawn else as_written(prompt)
        scope = (self._borne(bare, lists) if bare.stated else None) or self._match(prompt, lists)
        decided = scope.left is None and scope.verdict != "unknown"
        return replace(scope, left="part") if decided and self._may_leave_out(prompt) else scope

    def _may_leave_out(self, prompt: str) -> bool:
        """Return True if one of several clauses names no action of the vocabulary."""
        words = self._phrases.words(prompt)
        found = (match for match in self._phrases.find(words) if any(each.action for each in match.meanings))
        named = {at for match in found for at in range(match.start, match.end)}
        clauses = list[list[int]]([[]])
        for at, word in enumerate(words):
            if word.text in self._lists.breaks:
                clauses.append([])
            elif word.text.isalpha() and word.text not in self._lists.skipped and not word.text.endswith("ly"):
                clauses[-1].append(at)
        said = [clause for clause in clauses if clause]
        return len(said) > 1 and not all(named & set(clause) for clause in said)

    def _borne(self, bare: BarePrompt, lists: ActionLists) -> Scope | None:
        """Return the scope of a prompt whose bearings are drawn: that of its other words, and the gestures, which every
        bundle knows; None if no action that it names can be done with such a bearing, or nothing is done in it."""
        rest = self._match(bare.text, lists) if bare.text else None
        named = {each.action for each in rest.actions if each.action} if rest else set[str]()
        does = [each for each in bare.stated if not each.whole and (each.bearing.gesture or each.bearing.arms)]
        if not any(map(bare.fits, named or {STANDING})) or not (named or does):
            return None
        alone = [each for each in bare.stated if not each.bearing.lasts or not rest]
        alike = [each for each in bare.stated if each.bearing.approximated]
        like = next((name for name in ("walk", "run") if name in named), STANDING)
        drawn = (
            *(NamedAction(each.words[:MAX_TEXT], "close", read_as=like) for each in alike),
            *(NamedAction(each.words[:MAX_TEXT], "known") for each in alone if each not in alike),
        )
        others = rest.actions if rest and (named or not drawn) else ()
        flags: tuple[Flag, ...] = tuple(
            flag
            for flag in self._match(bare.prompt, lists).flags
            if not (flag == "no-action" and (named or drawn)) and not (flag == "other-subject" and rest and named)
        )
        return Scope((*others, *drawn), flags, left=rest.left if rest and named else None)

    def _match(self, prompt: str, lists: ActionLists) -> Scope:
        read = self._read(prompt)
        if not read.phrases:
            return Scope((_nothing(prompt),), read.flags, left=read.left)
        scope = Scope(tuple(_unique(self._named(phrase, lists) for phrase in read.phrases)), read.flags)
        return scope if scope.verdict == "unknown" else replace(scope, left=read.left)

    def _read_words(self, prompt: str) -> _Reading:
        words = self._phrases.words(prompt)
        named = self._phrases.find(words)
        denied = self._denied(words, named)
        done = [match for match in named if not denies(denied, match.start)]
        found = self._roles.actions(words, self._phrases.proper(words, done))
        found = self._movements.read(words, found, denied)
        said = sorted({*found, *(match for match in named if denies(denied, match.start))}, key=lambda each: each.start)
        flags = list(self._flagger.details(words, said, negated=bool(denied)))
        if stated_length(prompt).is_partial:
            flags.append("length")
        foreign = self._flagger.foreign(words, found)
        if foreign is not None or not found:
            left = "verb" if foreign is None and self._may_act(words, denied) else None
            return _Reading((), (*flags, foreign or "no-action"), left)
        if "counts" in flags and self._are_counted(prompt, found):
            flags.remove("counts")
        if self._flagger.has_other_script(words):
            flags.append("other-language")
        phrases = tuple(
            _Phrase(" ".join(word.text for word in words[match.start : match.end]), match.meanings)
            for match in self._in_context(found)
        )
        return _Reading(phrases, tuple(flags), "noun" if self._phrases.may_be_things(words, found) else None)

    def _are_counted(self, prompt: str, found: Sequence[Match]) -> bool:
        """Return True if the number that a prompt states is read, and its actions can be done so often."""
        named = {meaning.action for match in found for meaning in match.meanings}
        actions = [name for name in named if name is not None and self._vocabulary.need(name).counted]
        return len(actions) == len(named) and any(stated_count(prompt, name) for name in actions)

    def _may_act(self, words: list[Word], denied: Sequence[Span]) -> bool:
        """Return True if a person is named, and more than what is not done: not "he never sits down"."""
        said = [word for at, word in enumerate(words) if not denies(denied, at)]
        return self._phrases.names_person(words) and (not denied or len(said) > _LEAST_SAID)

    def _denied(self, words: list[Word], found: Sequence[Match]) -> list[Span]:
        """Return the words of which no action is done; "does nothing" is one that is done. What ends as the prompt
        begins ("stops running") is asked for only where nothing else is."""
        denied = [
            span
            for span in self._negations.spans(words)
            if not any(match.start < span[0] < match.end for match in found)
        ]
        ended = self._negations.ended(words)
        if ended and any(not denies([*denied, *ended], match.start) for match in found):
            denied += ended
        return denied

    def read_as(self, prompt: str, action: str, lists: ActionLists) -> Scope:
        """Return the scope of a prompt in which the words name no action, read as this one."""
        flags: list[Flag] = [flag for flag in self.match(prompt, lists).flags if flag != "no-action"]
        return Scope((self._judged(prompt[:MAX_TEXT], Meaning(action, near=True), lists),), tuple(flags), by="encoder")

    def _in_context(self, found: list[Match]) -> Iterator[Match]:
        """Yield the phrases; of one that is several actions those that begin as the action before has ended: "gets up"
        behind "sits" is from a seat, behind "falls" from the floor."""
        support = ""
        for match in found:
            fitting = [each for each in match.meanings if support in _OFF_FEET and self._support(each) == support]
            if fitting and len({each.action for each in match.meanings}) > 1:
                match = replace(match, meanings=tuple(replace(each, near=False) for each in fitting))
            support = next((self._support(each) for each in match.meanings if each.action), "")
            yield match

    def _support(self, meaning: Meaning) -> str:
        """Return what carries the body in an action; nothing on the knees, with the hips as high as on a seat."""
        name = meaning.action
        return "" if name is None or name == "kneel" else self._vocabulary.actions[name].support

    def _named(self, phrase: _Phrase, lists: ActionLists) -> NamedAction:
        """Return the best of a phrase's meanings."""
        candidates = [self._judged(phrase.text, meaning, lists) for meaning in phrase.meanings]
        return min(candidates, key=lambda named: _ORDER[named.verdict])

    def _judged(self, text: str, meaning: Meaning, lists: ActionLists) -> NamedAction:
        name = meaning.action
        if name is None:
            return NamedAction(text, "unknown")
        if lists.knows(name):
            return NamedAction(text, "close", name, name) if meaning.near else NamedAction(text, "known", name)
        if name in lists.tried:
            return NamedAction(text, "tried", name)
        read_as = next((kind for kind in self._vocabulary.kinds(name) if lists.knows(kind)), None)
        return NamedAction(text, "close" if read_as else "unknown", name, read_as)


def _nothing(prompt: str) -> NamedAction:
    """Return what stands for the action of a prompt that names none."""
    return NamedAction(prompt[:MAX_TEXT], "unknown")


def _unique(named: Iterable[NamedAction]) -> Iterator[NamedAction]:
    """Yield actions once each, in their order."""
    seen = set[tuple[str, str]]()
    for action in named:
        key = (action.action or action.text, action.verdict)
        if key not in seen:
            seen.add(key)
            yield action


@lru_cache(maxsize=1)
def every_action() -> ActionLists:
    """Return the lists of a bundle that supports all actions: what a prompt names, whatever a model knows."""
    return ActionLists(supported=tuple(load_vocabulary().actions), drawn=True)


@lru_cache(maxsize=1)
def _matcher() -> ScopeMatcher:
    return ScopeMatcher(load_vocabulary())


def match_scope(prompt: str, lists: ActionLists) -> Scope:
    """Return the scope of a prompt by its words.

    Args:
        prompt: as `check_prompt` returns it.
        lists: actions of the bundle that will read it.
    """
    return _matcher().match(prompt, lists)


def match_as(prompt: str, action: str, lists: ActionLists) -> Scope:
    """Return the scope of a prompt whose words name no action, read as an action of the vocabulary."""
    return _matcher().read_as(prompt, action, lists)


def match_left_out(scope: Scope, parts: Iterable[str]) -> Scope:
    """Return the scope of a prompt of which these parts ask for movements that are in no action that is read."""
    return replace(scope, actions=(*scope.actions, *(NamedAction(part[:MAX_TEXT], "unknown") for part in parts)))


def match_as_thing(scope: Scope, prompt: str) -> Scope:
    """Return the scope of a prompt whose nouns name things and no action."""
    return Scope((_nothing(prompt),), (*scope.flags, "no-action"), by="encoder")
