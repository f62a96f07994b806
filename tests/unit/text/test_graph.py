"""The semantic graph: nodes, edges, caps, slots and adjacency."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.text.graph import EDGE_TYPES, MA, OTHERS, SemanticGraph, build_graph, edge_type
from marey.text.roles import Argument, Frame, spans_to_arguments

TEXT = "a person walks forward and waves"
FRAMES = (
    Frame(2, (Argument("ARG0", 0, 2), Argument("ARGM-DIR", 3, 4))),
    Frame(5, (Argument("ARG0", 0, 2),)),
)


def graph(max_actions: int = 4, max_specifics: int = 8) -> SemanticGraph:
    return build_graph(TEXT, FRAMES, max_actions=max_actions, max_specifics=max_specifics)


def test_the_paper_has_twelve_edge_types() -> None:
    assert len(EDGE_TYPES) == len(set(EDGE_TYPES)) == 12


def test_an_argument_of_two_verbs_is_one_node_with_two_edges() -> None:
    made = graph()
    assert [node.text for node in made.level("specific")] == ["a person", "forward"]
    assert [(e.source, e.target, e.type) for e in made.edges if e.target == 3] == [(1, 3, "ARG0"), (2, 3, "ARG0")]


@pytest.mark.parametrize(
    ("role", "expected"),
    [
        ("ARG0", "ARG0"),
        ("ARGM-DIR", "ARGM-DIR"),
        ("R-ARG0", "OTHERS"),
        ("C-ARG1", "OTHERS"),
        ("ARGM-PRP", "OTHERS"),
        ("MA", "OTHERS"),
    ],
)
def test_roles_map_to_edge_types_as_in_graphmotion(role: str, expected: str) -> None:
    assert edge_type(role) == expected


def test_the_role_the_labeller_gave_is_kept_beside_the_type() -> None:
    made = build_graph("he who walks", [Frame(2, (Argument("R-ARG0", 1, 2),))], max_actions=4, max_specifics=8)
    assert (made.edges[-1].type, made.edges[-1].role) == ("OTHERS", "R-ARG0")


def test_adjacency_is_symmetric_with_a_self_loop_on_every_real_node_only() -> None:
    adjacency = graph().adjacency(4, 8)
    slots = graph().slots(4, 8)
    assert adjacency.shape == (13, 13)
    assert np.array_equal(adjacency, adjacency.T)
    diagonal = adjacency.diagonal()
    assert diagonal[0] == MA
    assert all(diagonal[s] == (OTHERS if slots[s] >= 0 else -1) for s in range(1, 13))
    assert adjacency[0, 1] == adjacency[0, 2] == MA
    assert (adjacency[0, 5:] == -1).all(), "the motion touches its actions alone"


def test_slots_are_motion_then_actions_then_specifics() -> None:
    assert graph().slots(4, 8) == [0, 1, 2, -1, -1, 3, 4, -1, -1, -1, -1, -1, -1]


def test_what_the_caps_cut_is_reported() -> None:
    made = graph(max_actions=1, max_specifics=1)
    assert [node.text for node in made.nodes] == [TEXT, "walks", "a person"]
    assert made.cut.actions == ("waves",)
    assert made.cut.specifics == ("forward",)
    assert made.cut.edges == 3


def test_nothing_cut_is_falsy() -> None:
    assert not graph().cut


def test_a_prompt_without_verbs_is_its_motion_node() -> None:
    made = build_graph("zombie", (), max_actions=4, max_specifics=8)
    assert len(made.nodes) == 1
    assert made.adjacency(4, 8)[0, 0] == MA


def test_json_line_follows_the_contract() -> None:
    line = json.loads(json.dumps(graph().to_json()))
    assert list(line) == ["text", "words", "nodes", "edges", "cut"]
    assert line["nodes"][1] == {"id": 1, "level": "action", "text": "walks", "words": [2]}
    assert line["edges"][0] == {"from": 0, "to": 1, "type": "MA", "role": "MA"}
    assert {"from": 1, "to": 3, "type": "ARG0", "role": "ARG0"} in line["edges"]


@st.composite
def frames(draw: st.DrawFn) -> tuple[str, tuple[Frame, ...]]:
    count = draw(st.integers(1, 12))
    predicates = draw(st.lists(st.integers(0, count - 1), unique=True, max_size=6).map(sorted))
    found = []
    for predicate in predicates:
        tags = draw(
            st.lists(
                st.sampled_from(["O", "B-ARG0", "I-ARG0", "B-ARGM-DIR", "I-ARGM-DIR", "B-C-ARG1"]),
                min_size=count,
                max_size=count,
            )
        )
        found.append(Frame(predicate, spans_to_arguments(tags)))
    return " ".join(f"w{i}" for i in range(count)), tuple(found)


@given(frames(), st.integers(1, 4), st.integers(1, 5))
def test_any_frames_give_a_valid_graph_that_survives_json(
    sample: tuple[str, tuple[Frame, ...]], actions: int, specifics: int
) -> None:
    text, found = sample
    made = build_graph(text, found, max_actions=actions, max_specifics=specifics)
    made.validate()
    assert SemanticGraph.from_json(json.loads(json.dumps(made.to_json()))) == made
    assert len(made.level("action")) <= actions
    assert len(made.level("specific")) <= specifics
    kept = sum(1 + len(f.arguments) for f in found)
    assert len(made.edges) + made.cut.edges == kept


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["nodes"].pop(0),
        lambda d: d["nodes"][1].update(level="specific"),
        lambda d: d["nodes"][1].update(words=[99]),
        lambda d: d["edges"][0].update(type="ARG9"),
        lambda d: d["edges"][0].update({"from": 1, "to": 0}),
    ],
)
def test_a_graph_that_does_not_fit_together_is_refused(change: object) -> None:
    data = graph().to_json()
    change(data)  # type: ignore[operator]
    with pytest.raises(ValueError):  # noqa: PT011
        SemanticGraph.from_json(data)
