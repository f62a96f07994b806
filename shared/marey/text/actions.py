"""Split a prompt into its actions in order of time: "after bowing, she walks off" gives "a person is bowing" and "she
walks off".

A model that generates one action at a time (MOGO's steers) receives them one after another. English only, like all
captions: actions are joined by a closed set of words, so these are rules over the words and the graph's verbs. A prompt
that the rules do not split stays one action.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from marey.text.clause_normalization import normalize_clause, noun_of
from marey.text.clauses import LIMBS, LISTS, SIDES, SUBJECTS, Clause
from marey.text.graph import SemanticGraph

MAX_ACTIONS = 6
"""Actions of a prompt; what comes behind them stays in the last."""


def _whose(phrase: str) -> tuple[str, ...]:
    return ("he", "she", "they") if "~" in phrase else ("",)


_JOINS = [tuple(phrase.replace("~", who).split()) for phrase in LISTS["joins"] for who in _whose(phrase)]
_JOINS_BY_FIRST = {word: [join for join in _JOINS if join[0] == word] for word, *_ in _JOINS}
"""In the same order: long prompts ask at every word, and most words begin none."""
_EDGES = [phrase.split() for phrase in LISTS["edges"]]
_FRONTED = [phrase.split() for phrase in LISTS["fronted"]]
_ADVERBS, _PAUSES, _STILL, _REFERRING, _SMALL, _ASKING, _ASKED, _NOUNS = (
    frozenset(LISTS[name]) for name in ("adverbs", "pauses", "still", "referring", "small", "asking", "asked", "nouns")
)
_RESTORING, _UPWARD, _DOWNWARD, _ONWARD = (
    frozenset(LISTS[name]) for name in ("restoring", "upward", "downward", "onward")
)
_ENDS, _CONTINUING = (tuple(LISTS[name]) for name in ("ends", "continuing"))
_UNDOING, _LIFTING, _SWINGING = (tuple(LISTS[name]) for name in ("undoing", "lifting", "swinging"))
_TRAVELS, _TURNS, _KEEPING, _BOWING, _LASTING = (
    tuple(LISTS[name]) for name in ("travels", "turns", "keeping", "bowing", "lasting")
)


def split_actions(graph: SemanticGraph) -> tuple[str, ...]:
    """Split a prompt into actions, each as a sentence of its own; the prompt itself if there is only one."""
    text = _with_all_verbs(Clause(graph.words, frozenset(w for node in graph.level("action") for w in node.words)))
    clauses = [_trimmed(clause) for part in _by_connective(text) for clause in _by_verb(part)]
    merged = _merged([clause for clause in clauses if len(clause)])
    kept = [clause for clause in merged if not _pauses(clause)] or merged
    if len(kept) < 2:
        return (graph.text,)
    sentences = [normalize_clause(clause) for clause in kept]
    return (*sentences[: MAX_ACTIONS - 1], *filter(None, [" then ".join(sentences[MAX_ACTIONS - 1 :])]))


def _with_all_verbs(text: Clause) -> Clause:
    """Add verbs that a labeller takes for nouns: "walk ahead, slow to a stop, and bow", "halts, right hand wave"."""
    bidden = bool(text.verbs) and not _form(text.bare(min(text.verbs)))
    found = {k for k in range(len(text)) if (bidden and _imperative_after(text, k)) or _noun_after(text, k)}
    return replace(text, verbs=text.verbs | found)


def _imperative_after(text: Clause, at: int) -> bool:
    """Find an imperative after "and": "and bow", "and slowly bow"."""
    before = at - 2 if text.bare(at - 1).endswith("ly") else at - 1
    return text.bare(at) in _NOUNS and text.bare(before) == "and"


def _noun_after(text: Clause, at: int) -> bool:
    """Find a noun phrase after locomotion: "right hand wave"."""
    walked = any(text.bare(v).startswith(_TRAVELS) for v in text.verbs if v < at - 2)
    begins = text.stopped(at - 3, ",;") or text.bare(at - 3) == "and"
    named = text.bare(at).startswith("wav") and text.bare(at - 1) in LIMBS and text.bare(at - 2) in SIDES
    return walked and begins and named


def _by_connective(text: Clause) -> Iterator[Clause]:
    """Split at connectives, in order of time."""
    opening = _opening(text)
    edge = _edge(text) if opening else None
    if edge is not None:
        said, rest = text.cut(len(opening), edge), list(_by_connective(text.cut(edge)))
        yield from [*rest, said] if " ".join(opening) in LISTS["fronted_last"] else [said, *rest]
        return
    for at in range(1, len(text)):
        join = next((j for j in _JOINS_BY_FIRST.get(text.bare(at), ()) if _joins(text, at, j)), None)
        if join is not None:
            before, after = text.cut(0, at), list(_by_connective(text.cut(at + len(join))))
            yield from [*after, before] if " ".join(join) in LISTS["backward"] else [before, *after]
            return
    yield text


def _opening(text: Clause) -> list[str]:
    """The words that mark a fronted subordinate clause; "when the music starts" is not one."""
    found: list[str] = next((words for words in _FRONTED if text.bares[: len(words)] == words), list[str]())
    return [] if found == ["when"] and text.bare(1) not in {"done", "finished"} else found


def _edge(text: Clause) -> int | None:
    """End of the fronted clause: behind its comma, or before "she"; None if it describes no action."""
    comma = next((k + 1 for k in range(1, len(text) - 1) if text.stopped(k, ",")), None)
    who = next((k for k in range(2, len(text) - 1) if text.bare(k) in {"he", "she", "they"}), None)
    edge = comma if comma is not None else who
    if edge is None:
        return None
    said = text.bares[1:edge]
    acting = text.verbs & set(range(edge)) or _NOUNS & set(said) or any(word.endswith("ing") for word in said)
    return edge if acting else None


def _joins(text: Clause, at: int, join: tuple[str, ...]) -> bool:
    """Return True if two clauses are joined there by these words."""
    end = at + len(join)
    if end >= len(text) or any(text.bare(at + k) != word for k, word in enumerate(join)):
        return False
    if " ".join(join) in LISTS["clausal"]:  # not "bows before the king"
        if text.bare(at - 1) == "and":  # "walks on and, once there, bows": the order of the words
            return False
        follows = text.bare(end) in SUBJECTS and (text.is_verb(end + 1) or text.bare(end + 1) in {"has", "have", "is"})
        return text.bare(end).endswith("ing") or follows
    if join[0] in _ADVERBS:
        return text.stopped(at - 1)
    return not (len(join) == 2 and join[1] == "next" and text.bare(end) == "to")


def _by_verb(text: Clause) -> Iterator[Clause]:
    """Split a list of verbs: "runs, stops and bows"."""
    start = 0
    for at in range(1, len(text)):
        if at > start and _lists(text, at):
            yield text.cut(start, at)
            start = at
    yield text.cut(start)


def _lists(text: Clause, at: int) -> bool:
    """Return True if a further verb of a list begins at a word, behind "and" or a comma."""
    follows = text.bare(at) == "and" or text.stopped(at - 1, ",;")
    if not follows or not text.verbs & set(range(at)) or text.stopped(at - 1, "."):
        return False
    verb = at + (text.bare(at) == "and")
    if text.bare(verb) in SIDES:
        return _noun_after(text, verb + 2)
    while text.bare(verb).endswith("ly"):
        verb += 1
    if not text.is_verb(verb) or _form(text.bare(verb)) != _form(text.bare(min(text.verbs))):
        return False  # "lets the arm go up and come down", "walks, keeping the trunk upright"
    return not text.bare(verb).endswith("ing") or text.bare(at) == "and"


def _form(verb: str) -> str:
    """The ending shared by the verbs of a list: `s`, `ing`, or none."""
    return "ing" if verb.endswith("ing") else "s" if verb.endswith("s") else ""


def _trimmed(clause: Clause) -> Clause:
    """Remove time words at the edges of a clause."""
    changed = True
    while changed and len(clause):
        changed = False
        for words in _EDGES:
            count = len(words)
            if clause.bares[:count] == words:
                clause, changed = clause.cut(count), True
            elif clause.bares[-count:] == words and len(clause) > count:
                clause, changed = clause.cut(0, len(clause) - count), True
        asked = _asked(clause)
        if asked:
            clause, changed = clause.cut(asked), True
    return clause


def _asked(clause: Clause) -> int:
    """Number of words before the requested action: three in "have the character bow"; 0 without a request."""
    if clause.bare(0) == "please":
        return 1
    if clause.bare(0) not in _ASKING or clause.bare(1) not in _ASKED:
        return 0
    verb = next((k for k in range(2, min(len(clause), 5)) if clause.is_verb(k)), 0)
    return verb if verb and not any(clause.stopped(k) for k in range(verb)) else 0


def _merged(clauses: list[Clause]) -> list[Clause]:
    """Merge clauses that are no action of their own into the clause before; complete a second side of the same
    action."""
    found: list[Clause] = []
    for clause in clauses:
        if not found:
            found.append(clause)
        elif _done(found[-1]) and {found[-1].bare(v) for v in _done(found[-1])} <= _STILL and not _pauses(found[-1]):
            found[-1] = _joined(found[-1], clause)  # "stands with the feet together": how, not what
        elif any(goes(found[-1], clause) for goes in (_refers, _lasts, _undoes, _restores, _swings, _turns, _goes_on)):
            found[-1] = _joined(found[-1], clause)
        elif "same" in clause.bares and (other := _other_side(found[-1], clause)) is not None:
            found.append(other)  # "does the same with the right"
        elif clause.verbs or (_form(clause.bare(0)) and clause.bare(0) not in SUBJECTS | SIDES):
            found.append(clause)
        elif (other := _other_side(found[-1], clause)) is not None:
            found.append(other)
        elif found[-1].verbs and noun_of(clause) not in _NOUNS - {"turn"}:
            found[-1] = _joined(found[-1], clause)  # "walks forward, then left"
        else:
            found.append(clause)  # "straight steps and then a left turn"
    return found


def _refers(_: Clause, clause: Clause) -> bool:
    """Return True if a clause refers to the one before: "lowers it again", "comes up"."""
    verbs = {clause.bare(v) for v in clause.verbs}
    small = set(clause.bares) - verbs
    return bool(verbs) and (
        (bool(small & _REFERRING) and small <= _SMALL)
        or any(clause.bare(v + 1) in {"it", "them"} for v in clause.verbs)
    )


def _lasts(_: Clause, clause: Clause) -> bool:
    """Return True if a clause gives the duration of the one before: "holds two seconds", "keeps it there for a
    moment"."""
    first = min(clause.verbs, default=-1)
    short = first >= 0 and len(clause) - first <= 6 and not (LIMBS | {"left", "right"}) & set(clause.bares)
    return short and clause.bare(first).startswith(_LASTING) and not any(w.endswith("ing") for w in clause.bares)


def _undoes(before: Clause, clause: Clause) -> bool:
    """Return True if a clause ends the action before, unless that was locomotion: "lowers the arm", "straightens"."""
    if any(before.bare(v).startswith(_TRAVELS) for v in _done(before)) or {"walk", "run", "jog"} & set(before.bares):
        return False
    first = min(clause.verbs, default=-1)
    if first >= 0 and clause.bare(first).startswith(_UNDOING):
        return True
    return clause.bare(0).startswith(_UNDOING) and len(clause) < 4


def _restores(before: Clause, clause: Clause) -> bool:
    """Return True if a clause restores the posture: "comes back up" after a bow, "lets both arms fall" after a
    raise."""
    first = min(clause.verbs, default=0)
    who = 0 if LIMBS & set(clause.bares[:first]) else first
    said = {word for word in clause.bares[who:] if not word.endswith("ly")}
    if not said <= _RESTORING:
        return False
    if any(word.startswith(_BOWING) for word in before.bares):
        return bool(said & _UPWARD)
    lifted = any(word.startswith(_LIFTING + _SWINGING) or word == "up" for word in before.bares)
    return lifted and bool(said & _DOWNWARD)


def _swings(before: Clause, clause: Clause) -> bool:
    """Return True for "lifts both arms" followed by "waves to them": one wave."""
    lifted = any(before.bare(v).startswith(_LIFTING) for v in before.verbs)
    if not lifted or not clause.verbs or len(clause) > 4 or SIDES & set(clause.bares):
        return False
    return clause.bare(min(clause.verbs)).startswith(_SWINGING)


def _turns(before: Clause, clause: Clause) -> bool:
    """Return True for a walk and a turn in either order: "walks" and "turns left" are one action."""
    bares = clause.bares
    travels = any(before.bare(v).startswith(_TRAVELS + _TURNS) for v in _done(before))
    if not travels or not clause.verbs or LIMBS & {*bares, *before.bares}:
        return False
    if " ".join(bares[clause.bare(0) in SUBJECTS :]).startswith(_CONTINUING) and {"left", "right"} & set(before.bares):
        return not any(clause.bare(v).startswith(("run", "jog", "sprint")) for v in clause.verbs)
    sided = bool({"left", "right"} & set(bares))
    turned = any(clause.bare(v).startswith(_TURNS) for v in clause.verbs) or any(
        w.startswith(_TURNS[:6]) for w in bares
    )
    if turned and sided:
        return not {"left", "right"} & set(before.bares)
    return bares[-1] == "on" and len(bares) == 2 and bares[0].startswith(_TRAVELS)


def _goes_on(before: Clause, clause: Clause) -> bool:
    """Return True if locomotion continues: "breaks into a run" and "keeps running"; "turns left" and "walks off"."""
    first = min(clause.verbs, default=-1)
    if first < 0 or {"left", "right"} & set(clause.bares):
        return False
    verb, behind = clause.bare(first), clause.bare(first + 1)
    if verb.startswith(_KEEPING) and (
        behind in {"going", "moving", "on"} or behind[:3] in {w[:3] for w in before.bares}
    ):
        return any(word.startswith(_TRAVELS) or word == "foot" for word in before.bares)
    turned = {"left", "right"} & set(before.bares) and any(before.bare(v).startswith(_TURNS) for v in before.verbs)
    return bool(turned) and verb.startswith("walk") and behind in _ONWARD


def _done(clause: Clause) -> frozenset[int]:
    """Positions of the verbs of a clause, or of its first word if that is a verb in all but name ("walking on")."""
    return clause.verbs or frozenset({0} if clause.bare(0).endswith("ing") else ())


def _other_side(clause: Clause, side: Clause) -> Clause | None:
    """Complete a second side: "raises the left hand" and "the right one" gives "raises the right hand"."""
    before, after = (SIDES & set(part.bares) for part in (clause, side))
    if len(before) != 1 or len(after) != 1 or before == after:
        return None
    (old,), (new,) = before, after
    words = tuple(
        word.lower().replace(old, new) if bare == old else word
        for word, bare in zip(clause.words, clause.bares, strict=True)
    )
    return replace(clause, words=words)


def _joined(first: Clause, second: Clause) -> Clause:
    words = (*first.words, "then", *second.words)
    return Clause(words, first.verbs | {v + len(first) + 1 for v in second.verbs})


def _pauses(clause: Clause) -> bool:
    """Return True for a pause: "stops", "stands still", "comes to a halt at the door", "speeds up"; the next clause
    implies it."""
    if not clause.verbs:
        return False
    said = clause.bares[min(clause.verbs) :]
    return set(said) <= _PAUSES or " ".join(said).startswith(_ENDS)
