"""Rules of combat: strikes, weapons, hits and falls."""

from __future__ import annotations

import numpy as np

from marey.referee.aerial import OTHER, flights, jump, jump_forward
from marey.referee.body import HIPS, SIDES, Body, Floats, Mask, runs, swings
from marey.referee.gaits import gait, passage, planted, sneak, steady_gait, travel, turn, walk
from marey.referee.gestures import bow
from marey.referee.postures import sit_down, stand_up
from marey.referee.rules import rule


def _reach(body: Body, side: str) -> Floats:
    """Distance of a wrist from its shoulder."""
    return np.linalg.norm(body.own(f"{side}_wrist", f"{side}_shoulder"), axis=-1)


def _standing(body: Body, share: float = 0.6) -> bool:
    return body.most((body.height("pelvis") > 0.5 * HIPS) & (body.lean < 70), share)


def _guard(body: Body) -> Mask:
    """Return where both hands are held between waist and face, one of them ahead of the trunk, over a ready stance."""
    held, ahead, high = np.ones(len(body), np.bool_), np.zeros(len(body), np.bool_), np.zeros(len(body), np.bool_)
    for side in SIDES:
        hand = body.own(f"{side}_wrist")
        held &= (hand[:, 1] > 0.0) & (hand[:, 1] < 0.85) & (hand[:, 2] > -0.1) & (body.bend(side, "elbow") > 40)
        ahead |= hand[:, 2] > 0.05
        high |= hand[:, 1] > 0.3
    stance = np.linalg.norm((body.at("L_ankle") - body.at("R_ankle"))[:, [0, 2]], axis=-1) > 0.32
    # Robots and people who wait stand with straight legs, and hands at the waist.
    knees = np.maximum(body.bend("L", "knee"), body.bend("R", "knee")) > 15
    return held & ahead & stance & (knees | high) & (body.height("pelvis") > 0.6 * HIPS)


@rule("fight-stance")
def fight_stance(body: Body) -> bool:
    strikes = np.maximum(*(np.linalg.norm(body.own_velocity(f"{s}_wrist"), axis=-1) for s in SIDES))
    rests = np.maximum(body.speed("L_foot"), body.speed("R_foot")) < 0.3
    stays = travel(body) < 1.5 and planted(body, 0.1) and body.share(rests) >= 0.4
    return stays and _standing(body) and body.most(_guard(body)) and float(np.percentile(strikes, 85)) < 2.0


def _strikes(body: Body, side: str) -> int:
    """Count the movements of a fist at 2 m/s or more, straight ahead, across the face or up past it.

    In each the fist goes 0.12 m away from its shoulder, to before the body; arms that swing about the shoulder do not.
    Ahead and across the elbow straightens by 40 degrees. An uppercut may keep it bent: its fist rises from under the
    chin to the height of the head.
    """
    velocity = body.own_velocity(f"{side}_wrist", window=0.06)
    speed = np.linalg.norm(velocity, axis=-1)
    reach, elbow = _reach(body, side), body.bend(side, "elbow")
    hand, before = body.own(f"{side}_wrist", "neck"), body.own(f"{side}_wrist", f"{side}_shoulder")[:, 2]
    found = 0
    for begin, end in runs(speed >= 2.0):
        first, last = max(0, begin - body.frames(0.12)), min(len(body), end + body.frames(0.12))
        part = slice(first, last)
        far = first + int(reach[part].argmax())
        way = slice(first, far + 1)
        goes_out = reach[far] - reach[way].min() >= 0.12 and before[far] >= 0.2
        straightens = elbow[way].max() - elbow[far] >= 40
        ahead = velocity[begin:end, 2].max() > 1.2 or velocity[begin:end, 1].max() > 1.5
        straight = elbow[part].min() < 50 and hand[part][:, 2].max() > 0.25
        past_face = (
            (hand[part][:, 1].max() > -0.15) and hand[part][:, 2].max() > 0.2 and float(np.ptp(hand[part][:, 0])) > 0.2
        )
        across = ahead and straightens and (straight or past_face)
        if goes_out and (across or _rises_past_face(hand[part], velocity[begin:end])):
            found += 1
    return found


def _rises_past_face(hand: Floats, velocity: Floats) -> bool:
    """Return True if a fist, seen from the neck, comes up before the body from under the chin to the head."""
    top = int(hand[:, 1].argmax())
    middle = abs(hand[top, 0]) < 0.25 and hand[:, 2].max() > 0.25
    return bool(middle and velocity[:, 1].max() > 1.5 and hand[0, 1] < -0.15 and hand[top, 1] > 0.05)


@rule("punch")
def punch(body: Body) -> bool:
    still = planted(body) and travel(body) < 3.0
    return still and _standing(body) and any(_strikes(body, side) for side in SIDES)


def _kicks(body: Body, speed: float, height: float) -> int:
    found = 0
    for side in SIDES:
        fast = np.linalg.norm(body.own_velocity(f"{side}_ankle", window=0.06), axis=-1) >= speed
        toe = np.maximum(body.height(f"{side}_ankle"), body.height(f"{side}_foot"))
        out = np.linalg.norm((body.at(f"{side}_ankle") - body.at("pelvis"))[:, [0, 2]], axis=-1)
        # The heel of a runner rises behind the body, and the foot of a lifted knee hangs under it.
        extended = (body.own(f"{side}_ankle")[:, 2] > -0.15) & (body.bend(side, "knee") < 100)
        shown = (toe >= height) & (out >= 0.35) & extended
        for begin, end in runs(fast):
            found += bool(shown[begin : min(len(body), end + body.frames(0.15))].any())
    return found


@rule("kick")
def kick(body: Body) -> bool:
    return _standing(body, 0.5) and _kicks(body, 2.0, 0.45) > 0


@rule("kick-ball")
def kick_ball(body: Body) -> bool:
    peaks = {side: float(body.own_velocity(f"{side}_foot", window=0.06)[:, 2].max()) for side in SIDES}
    for side in SIDES:
        velocity = body.own_velocity(f"{side}_foot", window=0.06)
        foot = body.own(f"{side}_foot")
        swing = (velocity[:, 2] >= 3.0) & (body.height(f"{side}_foot") < 0.5)
        for begin, end in runs(swing):
            part = slice(max(0, begin - body.frames(0.2)), min(len(body), end + body.frames(0.25)))
            stands = (body.lift(OTHER[side])[begin:end] < 0.1).all()
            # A step swings both feet alike.
            swung = velocity[begin:end, 2].max() >= max(1.3 * peaks[OTHER[side]], 3.5)
            if foot[part][:, 2].min() < -0.1 and foot[part][:, 2].max() > 0.35 and stands and swung:
                return True
    return False


def _sweeps(body: Body) -> int:
    """Count arcs of a hand about the chest of 0.6 m and more, all at 2 m/s and more; the trunk may turn with it."""
    found = 0
    for side in SIDES:
        hand = body.at(f"{side}_wrist") - body.at("spine3")
        velocity = np.gradient(body.smooth(hand, 0.06), axis=0) * body.fps
        for begin, end in runs(np.linalg.norm(velocity, axis=-1) >= 2.0):
            part = hand[max(0, begin - 1) : end + 1]
            found += float(np.linalg.norm(np.diff(part, axis=0), axis=-1).sum()) >= 0.6
    return found


@rule("slash")
def slash(body: Body) -> bool:
    return _standing(body, 0.5) and not passage(body) and _sweeps(body) > 0


@rule("stab")
def stab(body: Body) -> bool:
    if passage(body) or travel(body) > 2.5:
        return False
    for side in SIDES:
        hand = body.own(f"{side}_wrist", "spine3")
        velocity = body.own_velocity(f"{side}_wrist", "spine3")
        for begin, end in runs(velocity[:, 2] > 0.4):
            part = hand[max(0, begin - 1) : end + 1]
            ahead = part[-1] - part[0]
            if velocity[begin:end, 2].max() >= 1.5 and ahead[2] >= 0.25 and np.abs(ahead[:2]).max() < 1.2 * ahead[2]:
                return _standing(body, 0.5)
    return False


@rule("block")
def block(body: Body) -> bool:
    if passage(body) or travel(body) > 0.8 or not planted(body) or not _standing(body, 0.5):
        return False
    for side in SIDES:
        hand, elbow = body.own(f"{side}_wrist"), body.bend(side, "elbow")
        up = (hand[:, 1] > 0.22) & (hand[:, 1] < 0.75) & (hand[:, 2] > 0.12) & (elbow > 50)
        calm = np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1) < 1.0
        for begin, end in runs(up & calm):
            before = slice(max(0, begin - body.frames(0.5)), begin + 1)
            risen = hand[begin, 1] - hand[before][:, 1].min() > 0.12
            held = begin == 0 and hand[begin, 2] > 0.2
            if (end - begin) / body.fps >= 0.2 and (risen or held):
                return True
    return False


def _aiming(body: Body) -> Mask:
    """Return where the body stands and holds a hand still, ahead of its chest and as high as breast to eyes."""
    held = np.zeros(len(body), np.bool_)
    for side in SIDES:
        height = body.own(f"{side}_wrist", "spine3")[:, 1]
        still = np.linalg.norm(body.smooth(body.own_velocity(f"{side}_wrist", "spine3"), 0.3), axis=-1) < 0.3
        held |= (body.ahead(f"{side}_wrist") >= 0.35) & (height > -0.1) & (height < 0.45) & still
    return held & (body.height("pelvis") > 0.75 * HIPS) & (body.lowest_foot < 0.12) & (body.lean < 40)


@rule("aim")
def aim(body: Body) -> bool:
    return body.longest(_aiming(body)) >= 1.0


@rule("shoot")
def shoot(body: Body) -> bool:
    """Aims; the hands jerk back by 0.015 m and more within 0.15 s and come ahead again."""
    if passage(body) or travel(body) > 1.0 or not planted(body) or not _standing(body, 0.5):
        return False
    step = body.frames(0.15)
    for side in SIDES:
        hand = body.own(f"{side}_wrist", "spine3")
        ahead = (hand[:, 2] > 0.28) & (hand[:, 1] > -0.2)
        distance = np.linalg.norm(hand, axis=-1)
        for frame in range(len(body) - step):
            before = slice(max(0, frame - body.frames(0.2)), frame + 1)
            held = ahead[before].all() and float(np.ptp(distance[before])) < 0.03
            back = distance[frame] - distance[frame : frame + step + 1].min()
            later = distance[frame + step : frame + step + body.frames(0.6)]
            if held and 0.015 <= back < 0.25 and later.max() - distance[frame : frame + step + 1].min() >= 0.5 * back:
                return True
    return False


@rule("draw-bow")
def draw_bow(body: Body) -> bool:
    if passage(body) or not planted(body):
        return False
    for side in SIDES:
        bow, string = body.own(f"{side}_wrist", f"{side}_shoulder"), f"{OTHER[side]}_wrist"
        out = (_reach(body, side) > 0.4) & (np.abs(bow[:, 1] - 0.1) < 0.3) & (body.bend(side, "elbow") < 55)
        face = np.minimum(
            np.linalg.norm(body.own(string, "head"), axis=-1),
            np.linalg.norm(body.own(string, f"{OTHER[side]}_shoulder"), axis=-1),
        )
        elbow_up = body.height(f"{OTHER[side]}_elbow") > body.height(f"{OTHER[side]}_shoulder") - 0.25
        if body.seconds(out & (face < 0.34) & elbow_up & (body.hand_apart() > 0.35)) >= 0.2:
            return True
    return False


@rule("cast-spell")
def cast_spell(body: Body) -> bool:
    if passage(body) or travel(body) > 0.8 or not planted(body) or not _standing(body, 0.5):
        return False
    for side in SIDES:
        reach = body.smooth(_reach(body, side), 0.1)
        height = body.height(f"{side}_wrist")
        calm = np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1) < 0.6
        hand = body.own(f"{side}_wrist", "spine3")
        away = ((hand[:, 2] > 0.3) & (hand[:, 1] > -0.1)) | (height > body.height("head"))
        way = body.within(hand, 0.8)
        for begin, end in runs(away & calm):
            before = slice(max(0, begin - body.frames(0.8)), begin + 1)
            if (end - begin) / body.fps >= 0.15 and way[before].max() >= 0.3 and reach[begin:end].max() > 0.35:
                return True
    return False


@rule("throw")
def throw(body: Body) -> bool:
    """A hand from behind its shoulder goes ahead at 3 m/s (2.5 from below) and stops there; no swing of a run or jump.

    In a throw from over the waist the elbow straightens; an arm may swing from below straight.
    """
    jumps = any(each.height > 0.1 and each.last == "both" for each in flights(body))
    if jumps or steady_gait(body) or not _standing(body, 0.5):
        return False
    for side in SIDES:
        hand, before = body.own(f"{side}_wrist", "spine3"), body.own(f"{side}_wrist", f"{side}_shoulder")[:, 2]
        velocity = body.own_velocity(f"{side}_wrist", "spine3", window=0.06)
        speed, elbow = np.linalg.norm(velocity, axis=-1), body.bend(side, "elbow")
        for begin, end in runs(velocity[:, 2] > 0.8):
            last = min(end, len(body) - 1)
            back = slice(max(0, begin - body.frames(0.6)), begin + 1)
            below = hand[begin:end, 1].mean() < 0
            fast = velocity[begin:end, 2].max() >= (2.5 if below else 3.0)
            swings_out = before[back].min() < -0.05 and before[last] > 0.15
            far = hand[last, 2] - hand[back][:, 2].min() >= 0.4
            bent = elbow[max(0, begin - body.frames(0.2)) : end].max()
            straightens = bent - elbow[max(0, begin - 1) : last + 1].min() >= 30
            stops = speed[end : end + body.frames(0.4)].min(initial=np.inf) < 1.0
            if fast and swings_out and far and (below or straightens) and stops:
                return True
    return False


@rule("dodge")
def dodge(body: Body) -> bool:
    """Nearly still before; the head goes 0.25 m at 0.8 m/s or more, not upward; no hand reaches for the floor.

    Who strikes, throws, jumps, bows, sits down or walks moves the head as far, and does not dodge.
    """
    found = gait(body)
    gone = travel(body) > 1.8 or found.steps > 5 or passage(body) or not planted(body)
    hands = min(float(body.height(f"{side}_wrist").min()) for side in SIDES)
    if gone or body.height("pelvis").min() < 0.5 * HIPS or hands < 0.45:
        return False
    others = (bow, jump, jump_forward, walk, sneak, turn, slash, punch, throw, sit_down, stand_up)
    if any(each(body) for each in others):
        return False
    head, speed = body.at("head"), body.speed("head")
    for frame in np.flatnonzero(body.within(head, 0.6) >= 0.25):
        part = slice(frame, frame + body.frames(0.6) + 1)
        way = head[part] - head[frame]
        far = way[int(np.linalg.norm(way, axis=-1).argmax())]
        before = speed[max(0, frame - body.frames(0.2)) : frame + 1].min()
        still = frame < body.frames(0.2) or before < 0.3
        if still and speed[part].max() >= 0.8 and far[1] < 0.1:
            return True
    return False


@rule("flinch")
def flinch(body: Body) -> bool:
    """Still before; head and chest jerk to a side, forward or back; the body comes back and has not gone down."""
    hips, head = body.height("pelvis"), body.at("head")
    stays = travel(body) < 0.8 and gait(body).steps < 6 and hips.min() > 0.75 * HIPS and planted(body)
    if not stays or passage(body) or not body.standing[-body.frames(0.2) :].any():
        return False
    level = np.array([1.0, 0.3, 1.0])
    jerk = np.minimum(body.within(head * level, 0.3), body.within(body.at("spine3") * level, 0.3) / 0.6)
    speed = body.speed("head")
    for frame in np.flatnonzero(jerk >= 0.08):
        before = speed[max(0, frame - body.frames(0.2)) : frame + 1]
        later = head[frame : frame + body.frames(2.0)]
        away = np.linalg.norm(later - head[frame], axis=-1)
        still = frame < body.frames(0.2) or before.min() < 0.2
        if still and away[-1] < 0.6 * away.max() and away.max() < 0.3:
            return True
    return False


@rule("die")
def die(body: Body) -> bool:
    last = slice(-body.frames(0.2), None)
    down = max(float(body.height(joint)[last].max()) for joint in ("pelvis", "spine3", "head"))
    first = body.height("pelvis")[: body.frames(1.0)].max()
    return down < 0.52 and first > 0.6 * HIPS


TECHNIQUE_HAND, TECHNIQUE_FOOT = 1.2, 2.0
"""Least speed of a hand, and of a foot at knee height, in a technique of a martial art, m/s."""
FORM_S = 3.0
"""Shortest clip in which techniques can be told to be a sequence."""


def _techniques(body: Body) -> int:
    """Count blows, blocks and kicks by when a limb is fastest, which slows down by half between two of them."""
    peaks: list[int] = []
    for side in SIDES:
        hand = np.linalg.norm(body.own_velocity(f"{side}_wrist", "spine3"), axis=-1) / TECHNIQUE_HAND
        foot = np.linalg.norm(body.own_velocity(f"{side}_ankle"), axis=-1) / TECHNIQUE_FOOT
        for speed in (hand, foot * (body.height(f"{side}_ankle") > 0.4)):
            for begin, end in runs(speed > 0.5):
                if speed[begin:end].max() >= 1.0:
                    peaks.append(begin + int(speed[begin:end].argmax()))
    count, last = 0, -len(body)
    for peak in sorted(peaks):
        if peak - last >= 0.3 * body.fps:  # both hands, or hand and foot, move in one technique
            count, last = count + 1, peak
    return count


@rule("karate")
def karate(body: Body) -> bool:
    """Three techniques in a stance of 0.45 m and more, turns or steps between them, and no steady walk."""
    if len(body) / body.fps < FORM_S or steady_gait(body) or not _standing(body):
        return False
    feet = np.linalg.norm((body.at("L_ankle") - body.at("R_ankle"))[:, [0, 2]], axis=-1)
    moves = len(swings(body.smooth(body.yaw, 0.2), 30)) + len(swings(feet, 0.25))
    return float((feet > 0.45).mean()) >= 0.3 and moves >= 1 and _techniques(body) >= 3
