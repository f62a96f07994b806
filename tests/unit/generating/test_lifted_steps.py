"""Feet that slide to their next place in a transition, and those that step there."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.shots.lifted_steps import between_stances, with_steps
from marey.motion.features import HUMANML3D_263
from marey.posing.bones import two_bones
from marey.posing.standing import LEFT, LEGS, RIGHT, eased
from tests.support.bodies import LENGTH, Body, walker

LAYOUT = HUMANML3D_263
SPAN = (20, 32)


def pushed(metres: float, rises: float = 0.0, *, drifts: float = 0.0) -> np.ndarray:
    """Return features (T, D) of a standing body whose right foot goes ahead and `rises` meanwhile, and whose left one
    `drifts` more slowly."""
    joints = Body(3.0, turn=40.0).joints()
    share = (np.arange(len(joints)) - SPAN[0]) / (SPAN[1] - SPAN[0])
    arc = np.sin(np.pi * np.clip(share, 0.0, 1.0))
    for side, far, up in ((RIGHT, metres, rises), (LEFT, drifts, 0.0)):
        hip, knee, ankle, toe = LEGS[side]
        joints[:, [ankle, toe], 2] += far * eased(share)[:, None]
        joints[:, [ankle, toe], 1] += up * arc[:, None]
        joints[:, knee], _ = two_bones(
            joints[:, hip], joints[:, ankle], np.tile([0.0, 0.0, 1.0], (len(joints), 1)), (LENGTH[knee], LENGTH[ankle])
        )
    return LAYOUT.encode(joints)


@pytest.mark.parametrize("drifts", [0.0, 0.12])
def test_a_foot_that_slides_steps_and_keeps_its_way(drifts: float) -> None:
    slides = pushed(0.3, drifts=drifts)
    before, after = (LAYOUT.decode(each).astype(float) for each in (slides, with_steps(slides, LAYOUT, [SPAN])))
    hip, knee, ankle, toe = LEGS[RIGHT]
    moved = after - before
    middle = (SPAN[0] + SPAN[1]) // 2
    assert moved[middle, [ankle, toe], 1] == pytest.approx(0.07, abs=0.015)
    assert np.abs(moved[:, [ankle, toe]][..., [0, 2]]).max() < 1e-4
    for joint, parent in ((knee, hip), (ankle, knee)):
        lengths = np.linalg.norm(after[:, joint] - after[:, parent], axis=-1)
        assert lengths == pytest.approx(np.linalg.norm(before[:, joint] - before[:, parent], axis=-1), abs=2e-3)
    others = [joint for joint in range(22) if joint not in (knee, ankle, toe)]
    assert np.abs(moved[:, others]).max() < 1e-5
    assert np.abs(moved[: SPAN[0] - 2]).max() < 1e-5
    assert np.abs(moved[SPAN[1] + 2 :]).max() < 1e-5


def test_a_foot_that_steps_by_itself_or_hardly_moves_stays() -> None:
    for features in (pushed(0.3, 0.08), pushed(0.05), LAYOUT.encode(walker(3.0))):
        assert with_steps(features, LAYOUT, [SPAN]) is features


def test_a_foot_that_slides_elsewhere_than_in_a_transition_stays() -> None:
    features = pushed(0.3)
    assert with_steps(features, LAYOUT, [(45, 53)]) is features


CUT = 25
"""Frame at which one stance is cut to another one."""


def stance(wide: float, frames: int) -> np.ndarray:
    """Return features (T, D) of a body that stands with its feet so many metres farther apart than at ease."""
    joints = Body(frames / LAYOUT.fps).joints()[:frames]
    for side, away in ((LEFT, wide / 2), (RIGHT, -wide / 2)):
        hip, knee, ankle, toe = LEGS[side]
        joints[:, [ankle, toe], 0] += away
        joints[:, knee], _ = two_bones(
            joints[:, hip], joints[:, ankle], np.tile([0.0, 0.0, 1.0], (len(joints), 1)), (LENGTH[knee], LENGTH[ankle])
        )
    return LAYOUT.encode(joints)


def ankles_apart(features: np.ndarray) -> np.ndarray:
    ankles = LAYOUT.decode(features)[:, [LEGS[side][2] for side in (LEFT, RIGHT)]]
    return np.linalg.norm(ankles[:, 0] - ankles[:, 1], axis=-1)


@pytest.mark.parametrize("span", [(CUT, CUT + 12), (CUT - 12, CUT)], ids=["into it", "out of it"])
def test_a_body_steps_from_one_stance_to_the_next(span: tuple[int, int]) -> None:
    cut = np.concatenate([stance(0.0, 40)[:CUT], stance(0.3, 60)[: 60 - CUT]])
    share = np.clip((np.arange(len(cut)) - CUT + 8) / 16, 0, 1)[:, None].astype(np.float32)
    pushed = (1 - share) * cut[:1] + share * cut[-1:]
    stepped = between_stances(pushed, LAYOUT, cut, [span])
    before, after = ankles_apart(cut)[[0, -1]]
    assert ankles_apart(stepped)[: span[0]] == pytest.approx(before, abs=0.01)
    assert ankles_apart(stepped)[span[1] :] == pytest.approx(after, abs=0.01)
    toes = LAYOUT.decode(stepped)[:, [LEGS[side][3] for side in (LEFT, RIGHT)]]
    lifted = np.ptp(toes[..., 1], axis=0)
    assert lifted == pytest.approx(0.07, abs=0.015)
    contacts = LAYOUT.contacts(stepped)
    assert not contacts[span[0] : span[1]].all(axis=0).any()
    assert contacts[: span[0]].all()
    assert contacts[span[1] :].all()


def test_a_stance_that_is_left_or_reached_on_the_move_stays() -> None:
    walks = LAYOUT.encode(walker(3.0))
    stands = stance(0.3, 60)
    for cut in (np.concatenate([walks[:CUT], stands[CUT:]]), np.concatenate([stands[:CUT], walks[CUT:]])):
        assert between_stances(cut, LAYOUT, cut, [(CUT, CUT + 12)]) is cut
