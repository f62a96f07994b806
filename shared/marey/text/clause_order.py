"""Clauses of a prompt, in the order in which their movements come (ours)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from marey.text.action_reader import OUTSIDE
from marey.text.clause_parts import begins_with_verb, is_on_other_side, only_named, parts_in_time
from marey.vocabulary.bearing_words import is_done_at_once, stated_bearings
from marey.vocabulary.gazes import without_gaze
from marey.vocabulary.scope import STANDING

CONTEXT = "no movement"
"""Class of a clause that asks for nothing: "while the others eat"."""
SURE = 0.15
"""Probability that each movement of a sequence has at least; one under `PLAIN` keeps its own words alone."""
PLAIN = 0.5
"""Probability from which on the action of a clause is said in plain words."""
_PAUSE = (
    r"(?:(?:an?|one|two|three|some|\d+) )?(?:short |brief |little |few |couple of )?"
    r"(?:moment|while|pause|beat|bit|second|time)s?"
)
_JOINING = re.compile(
    r"^(?:[\s,.;:+/>→\-–—&(]+|(?:and|then|next|finally|afterwards?|first|(?:only |not )?(?:before|until|once)|prior to"
    rf"|(?:only )?after(?: (?:that|this|{_PAUSE}))?|while|as|followed by|but|having|ending with)\b\s*)+",
    re.IGNORECASE,
)
"""Words and signs at the beginning of a clause that join it to others."""
_FRONTED = re.compile(r"^.*?(?=\b(?:as|while|whilst)\b)", re.IGNORECASE)
_MANNER = re.compile(
    r"in an? (?:\w+ )?(?:crouch|squat|stoop|hunch|trot|jog|run|sprint|walk|pose|stance|way)\b", re.IGNORECASE
)
"""Words that say how something is done, though one of them names an action."""
_FROM = re.compile(r"\W*from\ (?:a\ )?(?:ly|sitt|kneel|crouch|squatt|sleep|seat|prone|supine)\w*\b", re.IGNORECASE)
"""Beginning of words of the posture from which someone rises: "from lying on his back"."""
_WITH = re.compile(
    r"""\W*(?:(?P<unit>\w+)\ by\ (?P=unit)\b|(?:with|without|like|as\ if|using|behind|beside|above)\b(?!\ that\b)
    |(?:\d+|an?|one|two|three|four|five|six|seven|eight|nine|ten|several|a\ few)\ (?:\w+\ )?
    (?:strokes?|times?|blows?|hits?|knocks?|swings?|beats?|reps?|repetitions?|rounds?|turns?)\W*$)""",
    re.IGNORECASE | re.VERBOSE,
)
"""Beginning of words that say how or how often the movement before them is done: "with his sleeve", "four strokes"."""
_HELD = re.compile(
    r"""\W*(?:standing(?:\ (?:up|still|there))?(?=\W*(?:$|,))
    |(?:(?:with|his|her|their|the|both|one|left|right)\ )*(?:arms?|hands?|palms?|fists?|elbows?|eyes|chin|chest|head
    |shoulders?|knees?|legs?|feet|back|thumbs?|fingers?)\ (?:held\ |stretched\ |straight\ |wide\ |high\ )*
    (?:up|out|down|straight|high|raised|open|wide|apart|together|crossed|folded|bent|closed|lifted|spread|extended|low
    |overhead|forward|upwards?)\b(?!\ (?:and|then)\b))""",
    re.IGNORECASE | re.VERBOSE,
)
"""Beginning of how the body is held in the movement before it: "arm straight up", "standing"."""
_MEANWHILE = re.compile(r"\W*(?!(?:go|com|follow|end|be)ing\b)\w{2,}ing\b", re.IGNORECASE)
"""Beginning of what comes with the movement before it: "serves, tossing the ball"."""
_UNTIL = re.compile(r"\W*until (?:he|she|they|it)(?:'s|'re| (?:is|are|can\W?t|cannot|has|have))\b", re.IGNORECASE)
"""Words of the state in which a movement ends: "until he is worn out"."""
_END = re.compile(
    r"""(?:(?:he|she|they|it)\s)?(?:\w+ly\s)?(?:
    lands?(?:\s(?:softly|safely|on\s(?:both|his|her|their|the)\s(?:\w+\s)?feet))?
    |straightens?(?:\s(?:back|again|up|out))*
    |(?:recovers?|relaxes|relax)
    |(?:returns?|comes?|goes|go|gets?)\s(?:back\s)?(?:up\s)?to\s(?:a\s|the\s)?(?:neutral|rest|upright|standing)(?:\s\w+)?
    |lowers?\s(?:it|them|the\sarms?|(?:his|her|their)\s(?:arms?|hands?))(?:\s(?:back|again|down))*
    )""",
    re.IGNORECASE | re.VERBOSE,
)
"""Clauses of the end of a movement, which comes by itself."""
_PERSON = r"(?:(?:he|she|they|it)\s)?(?:\w+ly\s)?"
BOUND_TO_HANDS: Mapping[str, re.Pattern[str]] = {
    "drive": re.compile(
        rf"""{_PERSON}(?:(?:look|glanc|check|peer)\w*\b|(?:swerv|steer|honk|brak|accelerat)\w*\b
        |(?:takes?|makes?)\s(?:an?\s)?(?:sharp|hard|left|right)\b|turns?\s(?:sharply\s|hard\s)?(?:left|right|the\swheel)\b
        |(?:shift|chang)\w*\s(?:up|down|gears?))""",
        re.IGNORECASE | re.VERBOSE,
    ),
    "hang": re.compile(
        rf"""{_PERSON}(?:shimm\w*\b|(?:does|do)\s(?:\w+\s)?(?:pull|chin)[ -]?ups?\b
        |(?:kick|rais|lift|swing)\w*\s(?:(?:his|her|their|both|the)\s)+(?:legs|feet|knees)\b
        |(?:swing|sway)\w*(?:$|\s(?:gently|slowly|back|to|from|a\slittle)\b))""",
        re.IGNORECASE | re.VERBOSE,
    ),
}
"""Words of what is done at the wheel, or by the hands that hold, and is part of the movement before it."""
_OTHERS = re.compile(
    r"^\W*while (?:the|his|her|their|its|others|everyone|everybody|an?|some|two|three|nobody|no one)\b"
    r"(?!.*\b(?:he|she|they)\b)",
    re.IGNORECASE,
)
"""Beginning of a clause that tells what others do."""


_ONE = (("bend-over", "pick-up"),)
"""Pairs of movements of which the second begins with the first."""


@dataclass(frozen=True)
class ReadClause:
    """A part of a prompt with what it asks for.

    Attributes:
        name: id of an action, `OUTSIDE` or `CONTEXT`.
        probability: 0 to 1.
        text: as written.
        at_once: it comes at the same time as the clause before it.
        place: in time, among the clauses of the prompt that ask for a movement.
    """

    name: str
    probability: float
    text: str
    at_once: bool = False
    place: int = 0

    @property
    def moves(self) -> bool:
        """It asks for a movement."""
        return self.name != CONTEXT


def without_joints(text: str) -> str:
    """Return a clause without the words that join it to others: "and then he bows," is "he bows"; "as he runs, he
    waves" is one."""
    bare = _JOINING.sub("", text).strip(" ,.;:→>-(")
    if is_done_at_once(text) and not is_done_at_once(bare):
        bare = _FRONTED.sub("", text).strip(" ,.;:→>-(")
    return bare or text.strip()


def in_order(clauses: Sequence[ReadClause]) -> list[list[ReadClause]]:
    """Return clauses in groups, in the order of time; those of a group come at once.

    Clauses that ask for nothing are left out. One action in two clauses behind each other is one.
    """
    groups: list[list[ReadClause]] = []
    for clause in clauses:
        if not clause.moves:
            continue
        if groups and clause.at_once:
            groups[-1].append(clause)
        else:
            groups.append([clause])
    return _merged(sorted(groups, key=lambda group: group[0].place))


def _merged(groups: Sequence[list[ReadClause]]) -> list[list[ReadClause]]:
    merged: list[list[ReadClause]] = []
    for group in groups:
        last = merged[-1] if merged else []
        alike = len(group) == len(last) == 1 and (last[0].name, group[0].name) in (*_ONE, (group[0].name,) * 2)
        alike = alike and not is_on_other_side(last[0].text, group[0].text, group[0].name)
        if alike:
            surer = max(group[0].probability, last[0].probability)
            text = f"{last[0].text} {group[0].text}"
            merged[-1] = [replace(group[0], probability=surer, text=text, place=last[0].place)]
        else:
            merged.append(group)
    return merged


def with_belongings(clauses: Iterable[ReadClause]) -> list[ReadClause]:
    """Return clauses; what comes behind "from", says how or how often, or is the end of a movement belongs to the one
    before: "gets up from | lying on the ground", "sneaks ahead | in a crouch", "wipes his mouth | with a sleeve",
    "chops wood, | four strokes", "bows | and straightens up"; and so does what is done at a wheel or by hands that
    hold: "drives | and swerves left", "hangs from a ledge | and shimmies along"."""
    found: list[ReadClause] = []
    for clause in clauses:
        text = without_joints(clause.text)
        goes_on = BOUND_TO_HANDS.get(found[-1].name) if found else None
        how = _MANNER.match(clause.text) or _FROM.match(clause.text)
        how = how or (clause.name in (STANDING, OUTSIDE) and _UNTIL.match(clause.text))
        how = how or (bool(found) and comes_with(found[-1].text, clause.text))
        belongs = how or is_end(text) or (goes_on and goes_on.match(text))
        if found and (belongs or found[-1].text.lower().endswith((" from", " while"))):
            found[-1] = replace(found[-1], text=f"{found[-1].text} {clause.text}")
        else:
            found.append(clause)
    return found


def is_end(text: str) -> bool:
    """Return True if a clause without its joints is the end of a movement, which comes by itself: "lands softly"."""
    return _END.fullmatch(text) is not None


def comes_with(before: str, text: str) -> bool:
    """Return True if a clause says how or how often the one before it is done, or comes at the same time: "serves, |
    tossing the ball"; "walking in, | sitting down" are two."""
    if _WITH.match(text) or (_HELD.match(text) and begins_with_verb(_last_clause(before))):
        return True
    if not _MEANWHILE.match(text) or re.search(r"\b\w{2,}ing\b", before):
        return False
    return only_named(text) is None or _begins_with_manner(text)


def _begins_with_manner(text: str) -> bool:
    """Return True if a text begins with a way to move, not with a movement: "staggering under the load"."""
    first = text.strip(" ,;").split()[0].lower()
    return any(each.bearing.is_manner and each.first == first for each in stated_bearings(text))


def _last_clause(text: str) -> str:
    """Return the words of a text behind its last sign and its subject: "shrugs" of "he sits, the man shrugs"."""
    last = re.split(r"[,;:.]", text.strip(" ,;:."))[-1].strip()
    return re.sub(
        r"^(?:(?:the|an?|his|her|our|my) )(?:[\w-]+ ){1,2}?(?=\w+s\b)|^\w+ (?=\w+s (?:a|an|the|his|her)\b)", "", last
    )


def parted(clauses: Iterable[ReadClause]) -> Iterator[ReadClause]:
    """Yield clauses; one whose words name several actions in the order of time as these: "gets up and draws an arrow"
    may be cut late, and "rolls forward, gets up" is two. What others do meanwhile asks for nothing."""
    for number, clause in enumerate(clauses):
        if number == 0 and _OTHERS.match(clause.text):
            yield replace(clause, name=CONTEXT)
            continue
        parts = parts_in_time(clause.text, listed=number > 0)
        if len(parts) < 2:
            named = only_named(without_gaze(clause.text)) if clause.probability < SURE else None
            yield clause if named is None else replace(clause, name=named, probability=PLAIN)
            continue
        for place, (text, action) in enumerate(parts):
            surer = max(clause.probability, PLAIN)
            yield ReadClause(action, surer, text, clause.at_once and place == 0, clause.place)
