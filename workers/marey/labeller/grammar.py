"""Silver sentences for the role labeller: a small grammar of motion captions with PropBank frames.

Frames follow PropBank's rolesets as AllenNLP's parser labels them on KIT captions (whose subject is ARG0 of "walk",
ARG1 of "turn"; "with his left hand" is manner). It is there for what those captions hardly have: bows, waves, raised
hands, punches, slashes and dances, styles, imperatives, several sentences, and long coordinations.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from marey.text.roles import Argument, Frame

Words = tuple[str, ...]


@dataclass(frozen=True)
class Example:
    """A sentence and its frames."""

    words: Words
    frames: tuple[Frame, ...]


@dataclass(frozen=True)
class Verb:
    """One verb: forms `base third ing past`, the subject's role, and phrases by role, `optional` ones at random."""

    forms: str
    subject: str = "ARG0"
    required: tuple[tuple[str, str], ...] = ()  # (role, key of PHRASES or alternatives "a|b")
    optional: tuple[tuple[str, str], ...] = ()


SUBJECTS = (
    "a person|the person|a man|a woman|someone|somebody|a human|the human|the subject|he|she|a figure|the figure|"
    "a character|the man|a young man|an old woman|an elderly man|a tired person|a happy person|an actor|a dancer|"
    "the character|a guy|a girl|a boy|a child|a standing person|a person|a person|a person|a person|subject|person"
)
MODIFIERS = (
    "in a childish mood|in a good mood|with long hair|in a bad mood|of old age|on the left|with a limp|"
    "in a feminine mood|full of energy|in a musical mood|with low confidence|in a red shirt"
)
"""Stand between subject and verb, inside the subject's span."""
PRODUCT_VERBS = frozenset({"wave", "raise", "bow", "kick", "punch", "slash", "dance", "walk", "run", "turn"})
PHRASES = {
    "way": "forward|forwards|backward|backwards|straight ahead|to the left|to the right|to the side|left|right|"
    "sideways|straight forward|ahead|away|around|to his left|to their right|diagonally|back|straight|up|down|"
    "in reverse",
    "turn": "left|right|to the left|to the right|around|clockwise|counterclockwise|counter clockwise|to his left|"
    "to her right|in a circle|to the left side|back",
    "degrees": "90 degrees|180 degrees|a quarter turn|45 degrees|slightly|halfway|360 degrees|a little",
    "manner": "slowly|quickly|carefully|happily|angrily|sadly|casually|energetically|fast|normally|in a circle|"
    "like a zombie|like a robot|in an elderly manner|in a feminine way|in a masculine way|with confidence|"
    "without confidence|in a childish way|as if exhausted|with a limp|clockwise|counterclockwise|proudly|lazily|"
    "in the style of an old man|in a relaxed manner|at a normal pace|at a slow speed|with great energy|awkwardly|"
    "in a counter clockwise circle|in an exhausted way|like an old person|with both arms swinging|nervously|"
    "very slowly|very fast|a bit clumsily|with a swagger|cheerfully|with small steps|in a musical manner|"
    "like a street thug|in a not confident manner|with heavy steps|on tiptoe|wearily|gently|politely|deeply",
    "steps": "a few steps|two steps|three steps|four steps|several steps|one step|a couple of steps|five steps|5 steps",
    "time": "again|then|for a few seconds|once|twice|three times|for five seconds|repeatedly|first|finally|afterwards|"
    "for a while|several times|a few times|at the end",
    "place": "in place|on the spot|in the middle of the room|on the ground|in front of him|above his head|"
    "next to his head|across the room|on the floor|in the air|in front of their chest",
    "hand": "his left hand|his right hand|her left hand|her right hand|the left hand|the right hand|both hands|"
    "their left hand|their right hand|both his hands|his hand|one hand|his left arm|the right arm|both arms|his arms|"
    "left hand|right hand|their arms|her arms|both of his hands|his left and right hands|left arm|right arm|an arm",
    "foot": "his left foot|his right foot|the left leg|her right leg|their left foot|his knee|the right foot|one leg",
    "with_hand": "with his left hand|with the right hand|with both hands|with her right arm|with one hand|"
    "with left hand|with their left hand|using the right hand|with right hand|with both arms|using both hands|"
    "with his right fist",
    "with_foot": "with his left foot|with the right foot|with their right leg|with left leg|with her left foot",
    "thing": "something|an object|a ball|the ball|a box|it|a cup|the table|a stick|his opponent|the air|a target",
    "high": "over his head|to chest level|above the head|to shoulder height|high up|to his sides|up high|to the side",
    "goal": "to someone|at someone|to the audience|at the camera|to a friend|to the crowd|goodbye|hello",
    "body": "his head|his hips|his upper body|their body|her torso|his shoulders",
    "noun": "a kick|a low kick|a jump|a bow|a left turn|a squat|a wave|a punch|a turn to the right|a dance|a spin|"
    "a half turn|a slash|a high kick|a deep bow|a quarter circle to the left|a cartwheel|a t-pose|a backward step",
    "stepnoun": "a step|a big step|two steps|a few steps|three small steps|a sidestep|one step|a quick step|4 steps",
}
LEADING_ADVERBS = ("slowly", "quickly", "carefully", "happily", "angrily", "gently", "calmly", "sadly", "suddenly")
_LOCOMOTION = (
    ("ARGM-DIR", "way"),
    ("ARGM-MNR", "manner"),
    ("ARGM-EXT", "steps"),
    ("ARGM-TMP", "time"),
    ("ARGM-LOC", "place"),
)
_ADJUNCTS = (("ARGM-MNR", "manner"), ("ARGM-TMP", "time"))
VERBS = (
    *(
        Verb(forms, "ARG0", (), _LOCOMOTION)
        for forms in (
            "walk walks walking walked",
            "run runs running ran",
            "walk walks walking walked",
            "jog jogs jogging jogged",
            "march marches marching marched",
            "stroll strolls strolling strolled",
            "crawl crawls crawling crawled",
            "hop hops hopping hopped",
            "skip skips skipping skipped",
            "jump jumps jumping jumped",
            "sneak sneaks sneaking sneaked",
            "stomp stomps stomping stomped",
            "step steps stepping stepped",
            "sprint sprints sprinting sprinted",
            "stagger staggers staggering staggered",
        )
    ),
    Verb("stumble stumbles stumbling stumbled", "ARG1", (), _LOCOMOTION[:2]),
    Verb("move moves moving moved", "ARG1", (), _LOCOMOTION),
    Verb("turn turns turning turned", "ARG1", (), (("ARGM-DIR", "turn"), ("ARGM-EXT", "degrees"), *_ADJUNCTS)),
    Verb("turn turns turning turned", "ARG1", (("ARGM-DIR", "turn"),), _ADJUNCTS),
    Verb("spin spins spinning spun", "ARG1", (), (("ARGM-DIR", "turn"), *_ADJUNCTS)),
    Verb("rotate rotates rotating rotated", "ARG1", (), (("ARGM-EXT", "degrees"), ("ARGM-DIR", "turn"))),
    Verb("raise raises raising raised", "ARG0", (("ARG1", "hand"),), (("ARG4", "high"), *_ADJUNCTS)),
    Verb("raise raises raising raised", "ARG0", (("ARG1", "hand"), ("ARGM-DIR", "up|upward|upwards")), _ADJUNCTS),
    Verb("lift lifts lifting lifted", "ARG0", (("ARG1", "hand"),), (("ARG4", "high"), *_ADJUNCTS)),
    Verb("lift lifts lifting lifted", "ARG0", (("ARG1", "foot"),), _ADJUNCTS),
    Verb("lower lowers lowering lowered", "ARG0", (("ARG1", "hand"),), _ADJUNCTS),
    Verb("wave waves waving waved", "ARG0", (), (("ARGM-MNR", "with_hand"), ("ARGM-TMP", "time"))),
    Verb("wave waves waving waved", "ARG0", (), (("ARG2", "goal"), ("ARGM-MNR", "with_hand"), ("ARGM-TMP", "time"))),
    Verb("wave waves waving waved", "ARG0", (("ARG1", "hand"),), (*_ADJUNCTS, ("ARG2", "goal"))),
    Verb(
        "bow bows bowing bowed", "ARG0", (), (*_ADJUNCTS, ("ARGM-DIR", "forward|down|low|forwards"), ("ARG2", "goal"))
    ),
    Verb(
        "bend bends bending bent", "ARG0", (), (("ARGM-DIR", "forward|down|over|to the left|to the right"), *_ADJUNCTS)
    ),
    Verb("kick kicks kicking kicked", "ARG0", (), (("ARG1", "thing"), ("ARGM-MNR", "with_foot"), ("ARGM-TMP", "time"))),
    Verb("kick kicks kicking kicked", "ARG0", (), (("ARGM-DIR", "way"), ("ARGM-MNR", "with_foot"))),
    Verb("kick kicks kicking kicked", "ARG0", (("ARG1", "foot"),), (("ARGM-DIR", "way"), *_ADJUNCTS)),
    Verb("punch punches punching punched", "ARG0", (), (("ARG1", "thing"), ("ARGM-MNR", "with_hand"), *_ADJUNCTS[1:])),
    Verb("punch punches punching punched", "ARG0", (), (("ARGM-DIR", "way"), ("ARGM-MNR", "with_hand"))),
    Verb(
        "slash slashes slashing slashed",
        "ARG0",
        (),
        (("ARGM-DIR", "way"), ("ARGM-MNR", "with a sword|with_hand|with his sword|with a knife"), ("ARGM-TMP", "time")),
    ),
    Verb("swing swings swinging swung", "ARG0", (("ARG1", "hand|a sword|a bat|his sword"),), _ADJUNCTS),
    Verb("dance dances dancing danced", "ARG0", (), (*_ADJUNCTS, ("ARGM-LOC", "place"))),
    Verb(
        "throw throws throwing threw", "ARG0", (("ARG1", "thing"),), (("ARGM-MNR", "with_hand"), ("ARGM-DIR", "away"))
    ),
    Verb("clap claps clapping clapped", "ARG0", (("ARG1", "his hands|her hands|their hands|both hands"),), _ADJUNCTS),
    Verb("shake shakes shaking shook", "ARG0", (("ARG1", "body"),), _ADJUNCTS),
    Verb("hold holds holding held", "ARG0", (("ARG1", "hand"),), (("ARGM-LOC", "place"), _ADJUNCTS[1])),
    Verb("kneel kneels kneeling knelt", "ARG0", (), (("ARGM-DIR", "down"), *_ADJUNCTS)),
    Verb("sit sits sitting sat", "ARG1", (), (("ARGM-DIR", "down"), *_ADJUNCTS)),
    Verb("stand stands standing stood", "ARG1", (), (("ARGM-MNR", "still|straight|upright"), ("ARGM-TMP", "time"))),
    Verb("stand stands standing stood", "ARG1", (("ARGM-DIR", "up"),), _ADJUNCTS),
    Verb("stretch stretches stretching stretched", "ARG0", (("ARG1", "hand"),), (("ARGM-DIR", "way"),)),
    Verb("perform performs performing performed", "ARG0", (("ARG1", "noun"),), (("ARGM-MNR", "with_foot|with_hand"),)),
    Verb("do does doing did", "ARG0", (("ARG1", "noun"),), _ADJUNCTS),
    Verb("take takes taking took", "ARG0", (("ARG1", "stepnoun"),), (("ARGM-DIR", "way"), *_ADJUNCTS[1:])),
    Verb("make makes making made", "ARG0", (("ARG1", "noun|stepnoun"),), _ADJUNCTS[1:]),
    Verb("stop stops stopping stopped", "ARG1", (), (_ADJUNCTS[1],)),
    Verb("fall falls falling fell", "ARG1", (), (("ARGM-DIR", "down|over"), ("ARG4", "to the ground|on his knees"))),
    Verb("gesture gestures gesturing gestured", "ARG0", (), (("ARGM-MNR", "with_hand"), ("ARGM-DIR", "way"))),
    Verb("call calls calling called", "ARG0", (("ARG1", "someone|a friend"),), (("ARGM-MNR", "with_hand"),)),
    Verb("respond responds responding responded", "ARG0", (), _ADJUNCTS),
)


@dataclass
class _Builder:
    """Words and frames of the sentence so far."""

    words: list[str] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)

    def add(self, phrase: str) -> tuple[int, int]:
        """Append the words of `phrase`; the span they got."""
        start = len(self.words)
        self.words += phrase.split()
        return start, len(self.words)


def pick(key: str, rng: random.Random) -> str:
    """A phrase of one of the alternatives of `key`: keys of `PHRASES` or phrases themselves."""
    choice = rng.choice(key.split("|"))
    return rng.choice(PHRASES[choice].split("|")) if choice in PHRASES else choice


def sentence(rng: random.Random) -> Example:
    """One sentence of the grammar, without capitals and final stop (the augmentation adds noise)."""
    builder = _Builder()
    if rng.random() < 0.04:  # prompts without a verb: "a low kick with the left hand"
        builder.add(" ".join((pick("noun", rng), *([pick("with_hand", rng)] if rng.random() < 0.3 else []))))
        return Example(tuple(builder.words), ())
    style = rng.random()
    subject = None if style < 0.15 else _subject(builder, rng)
    form = 0 if subject is None else 2 if style < 0.4 else 3 if style < 0.45 else 1
    clauses = rng.choices((1, 2, 3, 4), (50, 33, 12, 5))[0]
    for index in range(clauses):
        lead: list[tuple[str, str]] = []
        if index:
            lead = _join(builder, rng)
        if form == 2 and (index == 0 or rng.random() < 0.3):
            builder.add("is")
        _clause(builder, rng, subject, form, lead)
        if rng.random() < 0.1:
            _while(builder, rng, subject)
    return Example(tuple(builder.words), tuple(sorted(builder.frames, key=lambda frame: frame.predicate)))


def _subject(builder: _Builder, rng: random.Random) -> tuple[int, int]:
    start, stop = builder.add(pick(SUBJECTS, rng))
    if rng.random() < 0.08:
        _, stop = builder.add(rng.choice(MODIFIERS.split("|")))
    return start, stop


def _verb(rng: random.Random) -> Verb:
    """A verb; those the captions hardly have and prompts often do come more often."""
    verb = rng.choice(VERBS)
    again = rng.random() < 0.4 and verb.forms.split()[0] not in PRODUCT_VERBS
    return rng.choice(VERBS) if again else verb


def _join(builder: _Builder, rng: random.Random) -> list[tuple[str, str]]:
    """Add a conjunction; "then" and its like are the next predicate's time."""
    joint = rng.choice(("and", "then", "and then", ", then", ", and", ",", ", and then", "and afterwards", "but then"))
    if joint.startswith(","):
        builder.words[-1] += ","
        joint = joint[1:].strip()
    if not joint:
        return []
    *conjunctions, last = joint.split()
    if last in ("then", "afterwards"):
        builder.words += conjunctions
        return [("ARGM-TMP", last)]
    builder.add(joint)
    return []


def _clause(
    builder: _Builder,
    rng: random.Random,
    subject: tuple[int, int] | None,
    form: int,
    before: list[tuple[str, str]],
) -> None:
    """Add a verb phrase whose subject stands elsewhere."""
    if form != 2 and rng.random() < 0.08:
        before = [*before, ("ARGM-MNR", rng.choice(LEADING_ADVERBS))]
    spans = [(role, *builder.add(phrase)) for role, phrase in before]
    if form != 0 and subject and rng.random() < 0.08:
        _start(builder, rng, subject, form, spans)
        return
    verb = _verb(rng)
    predicate, _ = builder.add(verb.forms.split()[form])
    spans += _arguments(builder, rng, verb)
    builder.frames.append(_frame(predicate, subject and (verb.subject, *subject), spans))


def _arguments(builder: _Builder, rng: random.Random, verb: Verb) -> list[tuple[str, int, int]]:
    spans = [(role, *builder.add(pick(key, rng))) for role, key in verb.required]
    count = rng.choices((0, 1, 2, 3), (22, 45, 28, 5))[0]
    chosen = rng.sample(verb.optional, min(count, len(verb.optional)))
    if rng.random() < 0.75:  # "walks forward slowly" rather than "walks slowly forward"
        chosen.sort(key=lambda item: item[0] != "ARGM-DIR")
    for role, key in chosen:
        spans.append((role, *builder.add(pick(key, rng))))
    return spans


def _start(
    builder: _Builder,
    rng: random.Random,
    subject: tuple[int, int],
    form: int,
    spans: list[tuple[str, int, int]],
) -> None:
    """ "starts to walk forward", "keeps walking": the second verb's phrase is ARG1 of the first."""
    outer = rng.choice(
        ("start starts starting started", "begin begins beginning began", "continue continues continuing continued")
    )
    predicate, _ = builder.add(outer.split()[form])
    start = len(builder.words)
    inner_form = 0 if rng.random() < 0.6 else 2
    if inner_form == 0:
        builder.add("to")
    verb = _verb(rng)
    inner, _ = builder.add(verb.forms.split()[inner_form])
    builder.frames.append(_frame(inner, (verb.subject, *subject), _arguments(builder, rng, verb)))
    spans = [*spans, ("ARG1", start, len(builder.words))]
    builder.frames.append(_frame(predicate, ("ARG0", *subject), spans))


def _while(builder: _Builder, rng: random.Random, subject: tuple[int, int] | None) -> None:
    """Add "while waving his left hand" to the last clause, as its time."""
    frame = builder.frames.pop()
    start = len(builder.words)
    builder.add(rng.choice(("while", "while", "while", "before", "after")))
    verb = _verb(rng)
    inner, _ = builder.add(verb.forms.split()[2])
    inner_frame = _frame(inner, subject and (verb.subject, *subject), _arguments(builder, rng, verb))
    time = Argument("ARGM-TMP", start, len(builder.words))
    builder.frames += [Frame(frame.predicate, (*frame.arguments, time)), inner_frame]


def _frame(predicate: int, subject: tuple[str, int, int] | None, spans: list[tuple[str, int, int]]) -> Frame:
    found = [Argument(*span) for span in ([subject, *spans] if subject else spans)]
    return Frame(predicate, tuple(sorted(found, key=lambda argument: argument.start)))
