"""Words around the movements of a prompt, left out before it is read (ours): titles before a colon, sentences that only
set the scene, signs between clauses, and the length of the whole ("keep it to 3 seconds").

The readers take all that is written for movements: of "tennis: serve" they read one clause with the title, and of an
arrow a row of its own.
"""

from __future__ import annotations

import re

from marey.text.action_reader import named_actions
from marey.text.clause_parts import begins_with_verb
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.lengths import TO_TEN, WHOLE, known_verb_forms
from marey.vocabulary.scope import STANDING
from marey.vocabulary.word_lists import load_word_lists

MOST_TITLE_WORDS = 4
"""Words of a title before a colon."""
_SIGNS = re.compile(
    r"\s*(?:<)?(?:[-=]{1,2}>|[→⇒➔➜»])\s*|\s+(?:>+|[/|+•·▪])\s+|\s*(?:…|\.{3,})\s+(?=[^\W\d_]{2})",
)
"""Signs between clauses."""
_DASHES = re.compile(r"^\s*-\s+(?=[^\W\d_])|\s-\s+(?=[^\W\d_])")
_BULLET = re.compile(r"^\s*[•·▪*»]\s+|^\s*-\s+(?=[^\W\d_])")
_SLUG_LINE = re.compile(
    r"^(?:INT|EXT)\b[^a-z]*?\b(?:DAY|NIGHT|MORNING|EVENING|DUSK|DAWN|CONTINUOUS|LATER)\b[.:,\s-]*(?=[^\W\d_])"
)
"""Place and time of a scene in a screenplay: "INT. OFFICE - DAY."."""
_LABEL = re.compile(
    r"""^(?:(?:scene|shot|take|cam(?:era)?|beat|clip|frame|seq(?:uence)?|cut|angle|panel|cue|part)
    (?:\ ?\#?(?:\d{1,4}[a-z]?|[a-z]|one|two|three|four|five))?(?:,\ )?)+(?:\s*:|\s[-–—])\s+(?=[^\W\d_])""",
    re.IGNORECASE | re.VERBOSE,
)
"""The number of a shot or a scene in a list: "SHOT B:", "Scene 4, take 2 -"."""
_SUMMARY = re.compile(
    r":\s+(?:(?:an?|the|just|simple|one)\s)+(?:[\w-]+\s){0,3}?(?:dance|routine|combo|combination|drill|exercise|sequence"
    r"|workout|move|step)\W*$",
    re.IGNORECASE,
)
"""A name behind a list, which says again what it is: "step left, step right, clap: a simple party dance"."""
_PURPOSE = re.compile(
    r"""(?:,\s+|\s+)(?:so\ that|in\ order\ that|lest|(?:so\ as|in\ order)(?=\ not\ to)
    |so(?=\ (?:he|she|they|it|nobody|no\ one|nothing)\ [a-z]))\s(?P<aim>[^,.;]+?)
    (?=\s*(?:$|[,.;!])|\s+(?:and\s+)?then\b)""",
    re.IGNORECASE | re.VERBOSE,
)
_NOT_DONE = re.compile(r"\b(?:not|never|no|nobody|nothing|cannot|without)\b|n't\b", re.IGNORECASE)
_BY_THEMSELVES = re.compile(r"(?:he|she|they|it)\b", re.IGNORECASE)
_TITLE = re.compile(r"^(?P<title>[^:.;,!?]{2,80}):\s+(?P<said>\S.*)$", re.DOTALL)
_EVENT = re.compile(
    r"^(?:[\w-]+ ){0,2}(?P<event>death|demise|patrol|collapse|knock-?down),\s+(?P<said>(?!then\b|and\b)\S.*)$",
    re.IGNORECASE | re.DOTALL,
)
"""An event that names what is told behind it: "death, shot in the chest, falls backward"."""
_TELLS = re.compile(r"(?:he|she|they|it)\b|[a-z]+(?:s|ing)\b|[a-z]+ (?:in|by|from|with)\b", re.IGNORECASE)
"""The beginning of what is told: who acts, a verb, or how a body is hit."""
_WISH = re.compile(
    r"""^(?:(?:ok(?:ay)?|hi|hello|hey|please|so|now)\ )*
    (?:(?:we|i|you)(?:\ (?:need|want|are|have)|'d|'re|'ll|\ would|\ could|\ will)\b
    |(?:please|give|make|create|animate|show|generate
    |do|imagine
    |picture|render|need|looking\ for)\ (?:me\ |us\ )?(?:a|an|the|some|one|this)\b
    |(?:what|here)\b|(?:he|she|they|it|the\ \w+|a\ \w+)\ (?:does|do)\ (?:this|the\ following|as\ follows|\w+\ things))
    """,
    re.IGNORECASE | re.VERBOSE,
)
"""Beginning of a sentence that says what is wanted, before a colon that begins it."""
_KINDS = re.compile(
    r"^(?:warm|cool)[ -]?(?:up|down)$|^(?:\w+ )?(?:workout|routine|combo|drill|loop|beat|bit|scene)$", re.I
)
_SPORTS = re.compile(r"\b(?P<sport>tennis|badminton|volleyball)\b", re.IGNORECASE)
_SERVES = re.compile(
    r"(?:(?<=^)|(?<=[,;.] )|(?<=\bthen )|(?<=\band ))(?:(?:he|she|they) )?serves?\b"
    r"(?! (?:the|a|his|her|up|tea|food)\b)",
    re.I,
)
_WANTED = re.compile(
    r"^(?:we|i)(?: need| want| would like|'d like)\b(?!.*\b(?:who|that|which|where|to|with|\w+ing)\b)", re.IGNORECASE
)
"""A sentence that names what is wanted, behind which it is told: "We need a death for the archer. She falls"."""
_LIST_AHEAD = re.compile(r",|;|\.\s|\b(?:then|and)\b", re.IGNORECASE)
_ARTICLE = re.compile(
    r"^(?:an?|the|this|that|one|two|three|four|five|\d+|he|she|they|it|his|her|their)\b", re.IGNORECASE
)
_SENTENCE = re.compile(r"^(?P<scene>[^.!?;:]{3,120})[.!]\s+(?P<said>[^\W\d_].*)$", re.DOTALL)
_PLACE = re.compile(
    r"""^(?:there(?:\ (?:is|are)|'s)|(?:it|this|we|you|they)(?:\ (?:is|are)|'s|'re)|(?:the|a|an)\ (?:[\w-]+\ ){1,3}
    (?:is|are)\ (?:in|at|on|inside|near|by|behind|under|dark|empty|lit|off|cold|wet|closed|open)
    |(?:setting|location|scene|int|ext)
    |in|at|on|inside|outside|imagine|picture)\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""Beginning of a sentence of a place or of who is there."""
_SOMEBODY = re.compile(
    r"^(?P<who>(?:an?|the)\ (?:[\w-]+\ ){0,2}?[\w-]+?)(?:\ (?:in|at|on|inside|near|by|behind)\ .*)?$", re.I | re.X
)
_PRONOUN = re.compile(r"^(?:he|she|they|it)\b", re.IGNORECASE)
_HOW = (
    r"(?:(?:crouched|hunched|stooped|bent|doubled)(?: (?:low|down|over|forwards?))*|stooping(?: low)?"
    r"|crouching(?: low)?|staying (?:low|quiet)|low to the (?:ground|floor)|on tip-?toes?)"
)
_FAR = (
    r"(?:(?:for|about|around|roughly|approximately|approx\.?|over|some|maybe|ca\.?|~) ?)*"
    rf"(?:\d{{1,3}}(?:[.,]\d+)?|{TO_TEN}) ?"
    r"(?:m|metres?|meters?|feet|ft|yards?|s|secs?|seconds?)(?: (?:forwards?|ahead|long))?"
)
_BELONGS = re.compile(rf",\s+(?=(?:{_HOW}|{_FAR})(?=\s*(?:[,;.]|$|and\b|then\b)))", re.IGNORECASE)
"""A comma before words that say how low, or how far, the movement before it is done."""
_VERBLESS = frozenset({"is", "are", "has", "have"})


def without_asides(prompt: str) -> str:
    """Return a prompt without what is no movement in it: "serves, then bows" of "tennis: serves -> bows".

    Args:
        prompt: as a user typed it, words one space apart.
    """
    text = WHOLE.sub("", prompt).strip(" ,;-–—(") or prompt
    text = _DASHES.sub(" • ", text).strip() if text.startswith("- ") or prompt.startswith("- ") else text
    text = _SIGNS.sub(", then ", _BULLET.sub("", text)) if _SIGNS.search(text) or _BULLET.match(text) else text
    text = _LABEL.sub("", _SLUG_LINE.sub("", text.strip(" ,")))
    text = _PURPOSE.sub(_without_aim, _without_scene(_without_title(text)))
    text = _SUMMARY.sub("", text) if _LIST_AHEAD.search(text.partition(":")[0]) else text
    return _BELONGS.sub(" ", text)


def _without_aim(found: re.Match[str]) -> str:
    """Return nothing for what a movement is done for; an aim that is itself a movement of who acts stays."""
    aim = found["aim"]
    moves = _BY_THEMSELVES.match(aim) and not _NOT_DONE.search(aim) and named_actions(aim) - {STANDING}
    return found[0] if moves else ""


def _without_title(text: str) -> str:
    """Return a text without the words before a colon that only name what comes: "Comedy bit:", "I need a loop:"; nor
    those of an event before a comma."""
    event = _EVENT.match(text)
    if (
        event is not None
        and _TELLS.match(event["said"])
        and named_actions(event["event"]) & named_actions(event["said"])
    ):
        return event["said"]
    found = _TITLE.match(text)
    if found is None:
        return text
    title, said = found["title"].strip(), found["said"]
    if not _WISH.match(title) and not (_is_title(title) and _LIST_AHEAD.search(said)):
        return text
    words = title.split()
    if len(words) < MOST_TITLE_WORDS and words[-1].lower() in load_word_lists().people and not _WISH.match(title):
        return f"{title} {said}"  # who does it
    sport = _SPORTS.search(title)
    return said if sport is None else _SERVES.sub(f"{sport['sport'].lower()} serve", said)


def _is_title(title: str) -> bool:
    """Return True if words before a colon name a kind or a subject, and are no clause or list of their own."""
    words = title.lower().split()
    if _KINDS.match(title):
        return True
    if len(words) > MOST_TITLE_WORDS or _ARTICLE.match(title) or begins_with_verb(title):
        return False
    return not any(word.endswith("s") and word in known_verb_forms() for word in words[1:])


def _without_scene(text: str) -> str:
    """Return a text without a first sentence that asks for nothing; who is named in it stays: "a spy sneaks" of "A spy
    in a corridor. He sneaks"."""
    found = _SENTENCE.match(text)
    if found is not None and _WANTED.match(found["scene"]) and _PRONOUN.match(found["said"]):
        return found["said"]
    if found is None or not _is_scene(found["scene"]):
        return text
    who = _SOMEBODY.match(found["scene"])
    said = found["said"]
    if who is not None and not _PLACE.match(found["scene"]) and _PRONOUN.match(said):
        return _PRONOUN.sub(who["who"], said, count=1)
    return said


def _is_scene(sentence: str) -> bool:
    """Return True if a sentence names a place or a person, and nothing that is done or shown."""
    words = [word.strip(" ,'\"").lower() for word in sentence.split()]
    verbs = any(word in known_verb_forms() and word.endswith("s") for word in words[1:]) or begins_with_verb(sentence)
    named = named_actions(sentence) - {STANDING}
    noun_phrase = _SOMEBODY.match(sentence) is not None and not verbs and not _VERBLESS.intersection(words)
    if any(word.endswith("ing") for word in words) and named:
        return False
    if not (_PLACE.match(sentence) or noun_phrase) or stated_bearings(sentence):
        return False
    return not named or (noun_phrase and not any(word.endswith("ing") for word in words))
