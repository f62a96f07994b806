"""Captions from facts, by a seeded grammar (`grammar.toml`). Every statement is a label confirmed by the motion or a
number measured on it."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Sequence
from dataclasses import dataclass

from marey.data.describe import LOCOMOTION, Facts
from marey.data.english import conjugate, mentioned_again, possessive, sentence, with_adjective
from marey.data.grammar import grammar
from marey.data.human_captions import human_caption, human_sequence
from marey.data.phrases import details, fields, fill, filled, phrase_of, with_adverb

_UNADJECTIVED = ("he", "she", "someone", "somebody")
LONG_WORDS = (30, 60)
HUMAN_SHARE = 0.5
SEPARATE_SHARE = 0.4  # share of the captions of several actions
SEPARATE_WORDS = 18
NOUN_SHARE, WHOLE_SHARE, WHO_SHARE, PAIR_SHARE = 0.07, 0.1, 0.15, 0.35


def seeded(*parts: object) -> random.Random:
    """Random generator that depends only on the parts, with equal results on every machine."""
    return random.Random(hashlib.sha256("\0".join(map(str, parts)).encode()).digest())  # noqa: S311


@dataclass(frozen=True)
class _Voice:
    """Subject, verb form and pronoun of a caption."""

    subject: str
    form: str
    pronoun: str

    def clause(self, phrase: str) -> str:
        """Join the subject and the conjugated phrase."""
        verb = conjugate(phrase, "gerund" if self.form == "progressive" else self.form)
        if self.form == "progressive":
            verb = "is " + verb
        return f"{self.subject} {verb}" if self.subject else verb

    @property
    def again(self) -> str:
        """The subject as a pronoun, for its second mention before a verb."""
        who = mentioned_again(self.pronoun)
        return f"{who} is" if self.form == "progressive" else who


def _voice(rng: random.Random, *, plain: bool, adjective: str = "", who: Sequence[str] = ()) -> _Voice:
    """Draw a voice. `plain` excludes captions without a subject ("walking forward"); `who` are further subjects."""
    draw = rng.random()
    if not plain and draw < 0.3 and not adjective:
        return _Voice("", "base" if draw < 0.15 else "gerund", rng.choice(["the", "their"]))
    subject = rng.choice(who if who and rng.random() < WHO_SHARE else grammar().subjects)
    if adjective and (subject in _UNADJECTIVED or " " not in subject):
        subject = "a person"
    return _Voice(with_adjective(subject, adjective), "progressive" if draw > 0.82 else "third", possessive(subject))


def _voice_of(subject: str, rng: random.Random) -> _Voice:
    return _Voice(subject, "progressive" if rng.random() < 0.2 else "third", possessive(subject))


def short_caption(facts: Facts, rng: random.Random) -> str:
    """Return a few words: the action, with or without its style as an adverb or adjective."""
    style = grammar().styles[facts.style]
    words = grammar().actions[facts.action]
    if verbless := _verbless(facts, rng):
        return _loosen(with_adverb(verbless, rng.choice(style.after)), rng)
    draw = rng.random()
    adjective = rng.choice(style.adjective) if style.adjective and draw < 0.3 else ""
    if style.who and not adjective and draw < 0.45:
        voice = _voice_of(rng.choice(style.who), rng)
        return _loosen(with_adverb(voice.clause(phrase_of(facts, rng, voice.pronoun)), ""), rng)
    voice = _voice(rng, plain=False, adjective=adjective, who=words.who)
    text = voice.clause(phrase_of(facts, rng, voice.pronoun))
    after = "" if adjective or draw > 0.88 else rng.choice(style.after)
    if after and rng.random() < 0.12 and voice.subject:
        return sentence(f"{after}, {with_adverb(text, '')}")
    return _loosen(with_adverb(text, after), rng)


def _verbless(facts: Facts, rng: random.Random) -> str | None:
    """Draw a caption without a person (a noun phrase, or a limb as its subject), or None."""
    words = grammar().actions[facts.action]
    draw = rng.random()
    phrases = words.nouns if draw < NOUN_SHARE else words.whole if draw < NOUN_SHARE + WHOLE_SHARE else ()
    if not phrases or facts.repeats > 1:
        return None
    text, _ = filled(phrases, fields(facts, rng, "the"), rng)
    return conjugate(text, "base" if facts.side == "both" else "third")


def long_caption(facts: Facts, rng: random.Random) -> str:
    """Return a caption of 30 to 60 words: action, style, duration, distance and limbs."""
    g = grammar()
    style = g.styles[facts.style]
    voice = _voice(rng, plain=True)
    values = fields(facts, rng, voice.pronoun)
    action = with_adverb(voice.clause(phrase_of(facts, rng, voice.pronoun)), rng.choice(style.after))
    names = details(facts)
    rng.shuffle(names)
    clauses = [text for name in names[:2] if (text := fill(rng.choice(g.details[name].clause), values))]
    said = [text for name in names[2:] if (text := fill(rng.choice(g.details[name].sentence), values))]
    sentences = [sentence(", ".join([action, *clauses])), rng.choice(style.sentence), *map(sentence, said)]
    again = _voice(rng, plain=True)
    while len(" ".join(sentences).split()) < LONG_WORDS[0]:
        more = with_adverb(again.clause(phrase_of(facts, rng, again.pronoun)), "")
        sentences.append(sentence(f"{rng.choice(_AGAIN)} {more}"))
    words, kept = 0, []
    for text in sentences:
        words += len(text.split())
        if kept and words > LONG_WORDS[1]:
            break
        kept.append(text)
    return " ".join(kept)


_AGAIN = ("In other words,", "Seen from outside,", "That is to say,", "To put it differently,", "In short,")


def joined_caption(parts: Sequence[Facts], rng: random.Random) -> str:
    """Join two or three actions in order, each with its verb."""
    g = grammar()
    same = len({facts.style for facts in parts}) == 1
    style = g.styles[parts[0].style]
    voice = _voice(rng, plain=False, who=style.who + g.actions[parts[0].action].who if same else ())
    text = _pair(parts, rng) if len(parts) == 2 and rng.random() < PAIR_SHARE else None
    if text is None:
        text = _framed(parts, rng, voice, same=same)
    after = rng.choice(style.after) if same and rng.random() < 0.6 else ""
    return _loosen(f"{_spoken(text, voice)} {after}", rng)


def separate_caption(parts: Sequence[Facts], rng: random.Random) -> str:
    """Caption each action separately, as varied as captions of single actions."""
    first, *others = (_act_alone(facts, rng) for facts in parts)
    join = rng.choice(_THEN)
    return _loosen("".join([first, *(join + text for text in others)]), rng)


def _act_alone(facts: Facts, rng: random.Random) -> str:
    """A caption of one short sentence, without its full stop."""
    for _ in range(20):
        text = (rng.random() < HUMAN_SHARE and human_caption(facts, rng)) or short_caption(facts, rng)
        text = text.removesuffix(".")
        if "." not in text and len(text.split()) <= SEPARATE_WORDS:
            return lower_first(text)
    return short_caption(facts, rng).removesuffix(".")


def lower_first(text: str) -> str:
    """Lower the first letter of a sentence, to embed it in another."""
    return text if text.startswith("I ") else text[:1].lower() + text[1:]


_THEN = (", then ", ", and then ", " and then ", ". Then ", ". After that, ", ", after that ", ", and afterwards ")


def _pair(parts: Sequence[Facts], rng: random.Random) -> str | None:
    """Fill a phrase for this pair of actions ("slows to a walk"); None if the grammar has none."""
    joins, (first, second) = grammar().joins, parts
    phrases = joins.pairs.get(f"{first.action}-{second.action}", ())
    if first.action == second.action:
        phrases = joins.same.get(first.action, ())
    if not phrases:
        return None
    values = {f"{name}_{key}": value for name, facts in zip("ab", parts, strict=True)
              for key, value in fields(facts, rng, "the").items()}  # fmt: skip
    return filled(phrases, values, rng)[0]


def _framed(parts: Sequence[Facts], rng: random.Random, voice: _Voice, *, same: bool) -> str:
    """Fill a frame with the phrase of each action."""
    g = grammar()
    frames = g.joins.two if len(parts) == 2 else g.joins.three
    if len(parts) == 2 and parts[0].action in LOCOMOTION and parts[1].action not in LOCOMOTION:
        frames += g.joins.halt
    text = rng.choice([f for f in frames if voice.subject or "{who}" not in f]).replace("{who}", voice.again)
    for name, facts in zip("abc", parts, strict=False):
        after = rng.choice(g.styles[facts.style].after) if not same and rng.random() < 0.6 else ""
        phrase = with_adverb(phrase_of(facts, rng, voice.pronoun), after)
        for ending, form in (("", None), ("_ing", "gerund"), ("_base", "base")):
            said = conjugate(phrase, form) if form else phrase
            text = text.replace(f"{{{name}{ending}}}", said)
    return text


def _spoken(text: str, voice: _Voice) -> str:
    """Insert the subject and conjugate the verbs."""
    if text.startswith(("after ", "having ", "once ", "when ")):  # the subject follows the first action
        return conjugate(text, "gerund" if voice.form == "progressive" else voice.form)
    for opening in ("first ", "initially "):
        if text.startswith(opening) and voice.subject:
            return opening + voice.clause(text.removeprefix(opening))
    return voice.clause(text)


def _loosen(text: str, rng: random.Random) -> str:
    """Format a caption as a sentence (60 %), or as people type: no capital, no full stop."""
    proper = sentence(text)
    return proper if rng.random() < 0.6 else proper[:-1][:1].lower() + proper[:-1][1:]


LONG_SHARE = 0.5  # share of the captured clips; nearly every long caption is unique and needs its own text features


PHRASINGS = {"walk_back": 12, "bow": 8, "walk": 6, "run": 4, "turn": 4}
"""Captions per clip of actions that are drawn often but have few clips. With two captions each, 159 clips of walking
backward were drawn 50 times in an hour: prompt adherence was 98 % on known captions, 67 % on another author's."""


def phrasings(parts: Sequence[Facts], *, spliced: bool) -> int:
    """Number of captions of a clip: enough that none is drawn too often."""
    if len(parts) > 1:
        return 4
    return PHRASINGS.get(parts[0].action, 2 if spliced else 3)


def caption(parts: Sequence[Facts], rng: random.Random) -> str:
    """Draw one caption, by the grammar or from human captions."""
    if len(parts) > 1 and rng.random() < SEPARATE_SHARE:
        return separate_caption(parts, rng)
    if rng.random() < HUMAN_SHARE:
        text = human_caption(parts[0], rng) if len(parts) == 1 else human_sequence(parts, rng)
        if text is not None:
            return _loosen(text, rng) if text.endswith(".") else text
    return short_caption(parts[0], rng) if len(parts) == 1 else joined_caption(parts, rng)


def captions(parts: Sequence[Facts], seed: str, count: int = 3) -> tuple[str, ...]:
    """Generate different true captions of a clip: short ones, and a long one for half the clips of one action.

    Args:
        parts: the actions of the clip in order.
        seed: the clip's id, so that a clip has the same captions on every machine.
        count: number of captions.
    """
    rng = seeded("captions", seed)
    out: dict[str, None] = {}
    wanted = count
    if len(parts) == 1 and rng.random() < LONG_SHARE:
        wanted -= 1
    for _ in range(20 * count):
        if len(out) >= wanted:
            break
        out[caption(parts, rng)] = None
    if wanted < count:
        out[long_caption(parts[0], rng)] = None
    return tuple(out)
