"""Turns on the spot, spins, sidesteps, stairs and turns in the air: angles, ways, feet that stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.checks.kinematics import heading
from marey.data import gestures
from marey.data.describe import describe_text
from marey.data.gestures import KINDS, made_gestures
from marey.data.pack import PackClip
from marey.data.part import Part
from tests.support.bodies import FPS, Body

KINDS_OF_STEPS = ("turn-around", "sidestep", "spin", "jump-turn", "climb-stairs", "climb-onto", "climb-ladder")
COUNT = 9
APEX = 0.4  # metres


def part(content: str, joints: np.ndarray) -> Part:
    said = ((content,),)
    source = PackClip(content, "cmu", content, "", "train", 0, 0, source=content, captions=said)
    return Part(content, source, content, False, joints.astype(np.float32), describe_text(said, joints, FPS))


def jump() -> np.ndarray:
    """A jump from both feet of 0.57 s in the air, (60, 22, 3)."""
    joints = Body(3.0).joints()
    t = np.arange(len(joints)) / FPS
    rise = np.interp(t, [1.0, 1.283, 1.567], [0.0, 1.0, 0.0])
    joints[..., 1] += (APEX * (1 - (1 - rise) ** 2))[:, None]
    return joints


def climbs() -> list[Part]:
    """A body that sinks, and one that rises, by 0.8 m in 3 s."""
    sinking = Body(3.0).joints()
    sinking[..., 1] += np.linspace(0.8, 0.0, len(sinking))[:, None]
    return [part("climb-down", sinking), part("climb-ladder", sinking), part("climb-ladder", sinking[::-1])]


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        kinds = {action: replace(KINDS[action], count=COUNT) for action in KINDS_OF_STEPS}
        patch.setattr(gestures, "KINDS", kinds)
        return list(made_gestures([part("idle", Body(4.0).joints()), part("jump", jump()), *climbs()]))


def of(made: list[Part], action: str) -> list[Part]:
    found = [part for part in made if part.content == action]
    assert len(found) == COUNT
    return found


def facing(part: Part) -> np.ndarray:
    """Degrees to the side that is told, since the first frame, (T,)."""
    angle = heading(part.joints.astype(np.float64), FPS)
    return (angle - angle[0]) * (1 if part.source.side == "left" else -1)


def strays(part: Part) -> float:
    """Metres that the hips get away from where they began."""
    return float(np.linalg.norm((part.joints[:, 0] - part.joints[0, 0])[:, [0, 2]], axis=-1).max())


def slips(part: Part) -> float:
    """Largest speed over the floor, m/s, of the slower toe among frames with a toe on the floor."""
    toes = part.joints[:, [10, 11]].astype(np.float64)
    speed = np.linalg.norm(np.gradient(toes, axis=0)[..., [0, 2]], axis=-1).min(1) * FPS
    stands = toes[..., 1].min(1) < toes[..., 1].min() + 0.02
    return float(np.percentile(speed[stands], 90))


def test_turns_on_the_spot_step_to_the_side_that_is_told(made: list[Part]) -> None:
    for part in of(made, "turn-around"):
        assert 70 < facing(part)[-1] < 200
        assert facing(part).max() < facing(part)[-1] + 8
        assert strays(part) < 0.3
        lifted = np.ptp(part.joints[:, [10, 11], 1], axis=0)
        assert lifted.min() > 0.02


def test_spins_go_all_the_way_round_in_one_go(made: list[Part]) -> None:
    for part in of(made, "spin"):
        angle = facing(part)
        assert angle[-1] == pytest.approx(round(angle[-1] / 360) * 360, abs=20)
        assert angle[-1] > 300
        begins, ends = np.argmax(angle > 20), np.argmax(angle > angle[-1] - 20)
        assert (angle[-1] - 40) / (ends - begins) * FPS > 120
        assert strays(part) < 0.4


def test_sidesteps_go_across_the_way_they_face(made: list[Part]) -> None:
    for part in of(made, "sidestep"):
        moved = (part.joints[-1, 0] - part.joints[0, 0]).astype(np.float64)
        angle = np.radians(heading(part.joints.astype(np.float64), FPS)[0])
        left = moved[0] * np.cos(angle) - moved[2] * np.sin(angle)
        ahead = moved[0] * np.sin(angle) + moved[2] * np.cos(angle)
        assert left * (1 if part.source.side == "left" else -1) > 0.5
        assert abs(ahead) < 0.15
        assert np.abs(facing(part)).max() < 20


def test_jumps_turn_in_the_air_and_not_on_the_floor(made: list[Part]) -> None:
    for part in of(made, "jump-turn"):
        assert facing(part)[-1] > 88
        feet = part.joints[:, 11] - part.joints[:, 10]
        angle = np.unwrap(np.arctan2(feet[:, 0], feet[:, 2]))
        floor = part.joints[:, [10, 11], 1].min(1) < part.joints[:, [10, 11], 1].min() + 0.03
        stands = floor[1:] & floor[:-1]
        assert np.degrees(np.abs(np.diff(angle))[stands]).max() < 12


def test_a_foot_stays_in_every_step_and_the_captions_name_the_side(made: list[Part]) -> None:
    for part in made:
        if part.content.startswith("climb"):
            continue
        assert slips(part) < 0.15, (part.id, slips(part))
        other = {"left": "right", "right": "left"}[part.source.side]
        assert not any(other in text.lower() for author in part.source.captions[:3] for text in author)


def levels(part: Part, toe: int) -> np.ndarray:
    """Heights of a toe where it stands, in order, metres."""
    place = part.joints[:, toe].astype(np.float64)
    stands = np.linalg.norm(np.gradient(place, axis=0), axis=-1) * FPS < 0.05
    return place[stands, 1]


def test_each_foot_is_set_on_the_next_stair_but_one(made: list[Part]) -> None:
    ways = set()
    for part in of(made, "climb-stairs"):
        rise = float(part.joints[-1, 0, 1] - part.joints[0, 0, 1])
        way = 1 if rise > 0 else -1
        ways.add(way)
        assert abs(rise) > 0.25
        assert part.joints[-1, 0, 2] - part.joints[0, 0, 2] > 0.4
        steps = np.diff(levels(part, 10)) * way
        assert steps.min() > -0.01
        assert (steps > 0.1).sum() >= 1
        said = " ".join(text for author in part.source.captions for text in author).lower()
        assert ("upstairs" if way < 0 else "downstairs") not in said
    assert ways == {-1, 1}


def test_climbs_go_up_or_down_as_they_are_told(made: list[Part]) -> None:
    for part in of(made, "climb-onto"):
        assert part.joints[-1, 0, 1] - part.joints[0, 0, 1] > 0.4
    rises = []
    for part in of(made, "climb-ladder"):
        rises.append(float(part.joints[-1, 0, 1] - part.joints[0, 0, 1]))
        said = " ".join(text for author in part.source.captions for text in author).lower()
        assert ("descend" if rises[-1] > 0 else "ascend") not in said
    assert min(rises) < -0.4
    assert max(rises) > 0.4
