"""Names of takes as words."""

from __future__ import annotations

import pytest

from marey.vocabulary.scope import ActionLists, match_scope
from marey.vocabulary.take_names import as_words


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("idle_injured", "idle injured"),
        ("walk_old_man", "old man walk"),
        ("idle_guard_01", "guard idle"),
        ("pick_up_baby", "pick up baby"),
        ("DEATH_BACKWARD_01", "death backward"),
        ("DEATH_knees_then_forward", "death knees forward"),
        ("ATK_sword_combo_3hit", "attack sword combo 3 hit"),
        ("punch L, punch R, knee R", "punch left, punch right, knee right"),
        ("plan L", "plan L"),
        ("ATK_kick_x3", "attack kick x3"),
        ("LOCO_walk_limp_L", "walk limp left"),
        ("DEATH_walk_forward", "death forward"),
        ("DEATH_headshot_run_back", "death headshot back"),
        ("ENEMY_MELEE_01 - overhead swing w/ two hands", "melee - overhead swing with two hands"),
        ("WalkFwd_Loop_v02", "walk forward"),
        ("Turn180_R", "turn 180 degrees right"),
        ("Jump_180deg_L", "jump 180 degrees left"),
        ("take_cover", "take cover"),
        ("Take_01_walk", "walk"),
        ("crouch_walk_b", "crouch walk"),
        ("a_person_waves", "a person waves"),
        ("sits down w/o looking", "sits down without looking"),
        ("npc_01", "npc 01"),
        ("EMOTE_facepalm", "facepalm"),
        ("emote_01", "emote"),
        ("TRV_ledge_climb_up", "ledge climb up"),
        ("HIT_react_stomach", "gets hit in the stomach"),
        ("HIT_shoulder_L", "gets hit in the left shoulder"),
        ("HIT_back_heavy", "gets hit from behind heavy"),
        ("HIT_react", "hit react"),
        ("idle_combat_breathing", "combat idle"),
        ("idle_breathing_fight", "fight idle"),
        ("standing_idle_battle", "battle idle"),
        ("idle_tired_breathe_loop", "idle tired"),
        ("idle_heavy_breathing", "idle heavy breathing"),
        ("IDLE_BREATHE", "idle"),
        ("SOLDIER_RELOAD_STANDING", "soldier reloads"),
        ("RELOAD_STANDING", "reload"),
        ("soldier_reload_kneeling", "soldier reloads kneeling"),
        ("GUARD_WAVE_STANDING", "guard waves"),
        ("old_man_cough", "old man coughs"),
        ("stand_wave_R", "wave right"),
        ("sit_to_stand", "sit to stand"),
        ("crouch_to_standing", "crouch to standing"),
        ("stand_up_slow", "stand up slow"),
        ("standing_long_jump", "standing long jump"),
        ("guard_stand", "guard stand"),
        ("a person walks", "a person walks"),
        ("waves to user_name@example.com", "waves to user_name@example.com"),
        ("walks - slowly", "walks - slowly"),
    ],
)
def test_a_name_of_a_take_is_read_as_words(name: str, words: str) -> None:
    assert as_words(name) == words


def test_the_scope_of_a_name_is_that_of_its_words() -> None:
    lists = ActionLists(("walk", "die"))
    for name, action in (("LOCO_walk_L", "walk"), ("DEATH_BACKWARD_01", "die")):
        assert [each.action for each in match_scope(name, lists).actions] == [action]
