"""Bodies that crouch, duck and hide behind cover."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import TEMPOS, Sequel, both, near
from marey.posing.standing import LEFT, RIGHT

_KNEE = HandPlace((0.0, 0.08, -0.02), "knee", (0.8, -0.3, -0.5))
_HANDS = {
    "hang": {},
    "knees": both(_KNEE),
    "one-knee": {LEFT: _KNEE},
    "forearms": both(HandPlace((-0.1, 0.03, 0.26), "knee", (0.8, -0.2, -0.5))),
    "ready": both(HandPlace((0.1, -0.22, 0.26), "trunk", (0.8, -0.8, 0.0))),
    "head": both(HandPlace((0.04, 0.17, 0.04), "trunk", (0.7, -0.1, 0.6))),
}
_FORMS = {
    "crouch-low": {"up": (0.4, 0.52), "tilt": (12, 26), "spine": (14, 30), "hands": ("hang", "one-knee", "ready")},
    "crouch-half": {"up": (0.54, 0.63), "tilt": (18, 32), "spine": (14, 28), "hands": ("hang", "knees", "ready")},
    "crouch-haunches": {"up": (0.27, 0.34), "tilt": (2, 12), "spine": (16, 30), "hands": ("forearms", "knees")},
    "crouch-cover": {"up": (0.36, 0.5), "tilt": (14, 26), "spine": (24, 40), "hands": ("ready", "one-knee", "hang")},
    "crouch-duck": {"up": (0.4, 0.54), "tilt": (22, 34), "spine": (34, 48), "hands": ("head", "hang")},
}
"""Height of the hips, metres, lean of hips and spine, degrees, and where the hands may be."""

_WORDS = {"crouch-haunches": "haunches", "crouch-cover": r"cover\b", "crouch-duck": "duck"}
"""Words of the vocabulary that are true of one form alone."""


def _low(rng: random.Random, form: str) -> tuple[Posture, bool]:
    """A crouched posture of a form, and True if a hand protects the head; of a stance with one foot ahead, the left."""
    limits = _FORMS[form]
    up, tilt, spine = (rng.uniform(*limits[name]) for name in ("up", "tilt", "spine"))
    hands = rng.choice(limits["hands"])
    apart = rng.uniform(0.15, 0.7)
    knees: dict[str, Point] = dict.fromkeys(SIDES, (apart, 0.2, 1.0))
    back = (0.94 - up) * rng.uniform(0.24, 0.36)
    feet: dict[str, FootPlace] = {}
    if form == "crouch-haunches":  # on the balls of the feet, or the heels down and the hips far behind them
        heels = rng.random() < 0.6
        back = rng.uniform(0.12, 0.17) if heels else rng.uniform(0.2, 0.24)
        if heels:
            feet = {side: FootPlace((0.1, 0.125, 0.02), (0.25, -0.75, 0.6)) for side in SIDES}
    elif rng.random() < 0.45:
        ahead = rng.uniform(0.14, 0.24)
        feet = {
            LEFT: FootPlace((rng.uniform(0.09, 0.13), 0.07, ahead)),
            RIGHT: FootPlace((rng.uniform(0.1, 0.14), 0.115, -ahead), (0.2, -0.72, 0.65)),
        }
        back *= 0.4
    gaze = -0.6 * (tilt + spine) if form != "crouch-duck" else rng.uniform(5, 25)
    places = {side: replace(hand, at=near(rng, hand.at, 0.015)) for side, hand in _HANDS[hands].items()}
    return Posture(
        (0.0, up, -back), (tilt, 0, 0), (spine, 0, 0), (gaze, 0, 0), 0.8, places, feet, knees
    ), hands == "head"


def crouched(rng: random.Random) -> Posture:
    """Return a crouched posture without a hand on the head."""
    return _low(rng, rng.choice(("crouch-low", "crouch-half")))[0]


def _moved(rng: random.Random, low: Posture, still: bool) -> Posture:
    """The same crouch a moment later, looking elsewhere."""
    left, up, forward = low.pelvis or (0.0, 0.5, 0.0)
    much = 0.4 if still else 1.0
    spine = (low.spine[0] + rng.uniform(-4, 4) * much, rng.uniform(-3, 3) * much, rng.uniform(-10, 10) * much)
    look = rng.choice((0.0, rng.uniform(-45, 45))) * much
    pelvis = (left, up + rng.uniform(-0.015, 0.02), forward + rng.uniform(-0.01, 0.01))
    return replace(low, pelvis=pelvis, spine=spine, neck=(low.neck[0] + rng.uniform(-4, 4), 0, look))


def _peek(rng: random.Random, low: Posture) -> Posture:
    """Look over the cover, or round it; the hips stay low."""
    left, up, forward = low.pelvis or (0.0, 0.5, 0.0)
    if rng.random() < 0.5:
        return replace(low, pelvis=(left, min(up + 0.12, 0.62), forward), spine=(6, 0, 0), neck=(-8, 0, 0))
    aside = rng.choice((-1.0, 1.0)) * rng.uniform(14, 24)
    return replace(low, spine=(low.spine[0] - 6, aside, -0.6 * aside), neck=(low.neck[0] + 4, 0.4 * aside, 0))


def crouch(rng: random.Random) -> Gesture:
    form = rng.choices(list(_FORMS), (4, 4, 2, 4, 2))[0]
    low, covered = _low(rng, form)
    tempo = "quick" if form == "crouch-duck" else rng.choice(["quick", "", "", "slow"])
    down = rng.choice(("stay", "down", "down", "up"))
    if form == "crouch-duck":
        down = rng.choice(("down", "up"))
    fall = rng.uniform(*TEMPOS[tempo])
    still = rng.random() < 0.35
    done = Sequel([rng.uniform(0.1, 0.5)], [low])
    if down != "stay":
        done = Sequel([rng.uniform(0.1, 0.4)])
        done.then(fall, low, rng.uniform(0.1, 0.4))
    begin = done.times[-1]
    lasts = rng.uniform(1.2, 5.0) + (2.2 * fall if down == "up" else 0.8 * fall)
    while done.times[-1] < begin + lasts:
        peeks = form == "crouch-cover" and rng.random() < 0.45
        done.then(rng.uniform(0.5, 1.0), _peek(rng, low) if peeks else _moved(rng, low, still), rng.uniform(0.2, 0.9))
    if down == "up":
        done.then(1.1 * fall, STAND, 0.1)
    kinds = [
        form,
        f"crouch-{down}",
        f"crouch-{tempo}" if tempo and down != "stay" and form != "crouch-duck" else "",
        "crouch-head" if covered else "",
        "crouch",
    ]
    untrue = [words for name, words in _WORDS.items() if name != form]
    return replace(done.either(rng).gesture(rng, kinds), untrue="|".join(untrue))
