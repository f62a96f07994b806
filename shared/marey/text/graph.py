"""The semantic graph of a prompt (HGM³ Sec. 3.3 and App. B; node and edge types of GraphMotion, Jin et al. 2023).

One motion node (the sentence), action nodes (its verbs), specific nodes (their arguments). An edge runs from the
motion to each action (type `MA`) and from each action to its arguments (type = role, the rare ones `OTHERS`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.text.roles import Frame

LEVELS = ("motion", "action", "specific")
EDGE_TYPES = (
    "ARG0",
    "ARG1",
    "ARG2",
    "ARG3",
    "ARG4",
    "ARGM-LOC",
    "ARGM-MNR",
    "ARGM-TMP",
    "ARGM-DIR",
    "ARGM-ADV",
    "OTHERS",
    "MA",
)
OTHERS = EDGE_TYPES.index("OTHERS")
MA = EDGE_TYPES.index("MA")


def edge_type(role: str) -> str:
    """The edge type of a PropBank role: itself if it is one of the twelve, else `OTHERS` (R-ARG0, ARGM-PRP, …)."""
    return role if role in EDGE_TYPES and role != "MA" else "OTHERS"


@dataclass(frozen=True)
class Node:
    """One node. `words` are indices into the graph's words; the motion node has all of them."""

    id: int
    level: str
    text: str
    words: tuple[int, ...]


@dataclass(frozen=True)
class Edge:
    """`source` is the motion of an action, the action of an argument. `role` keeps the labeller's own name."""

    source: int
    target: int
    type: str
    role: str


@dataclass(frozen=True)
class Cut:
    """Nodes and edges that exceeded the caps, as text."""

    actions: tuple[str, ...] = ()
    specifics: tuple[str, ...] = ()
    edges: int = 0

    def __bool__(self) -> bool:
        return bool(self.actions or self.specifics or self.edges)


@dataclass(frozen=True)
class SemanticGraph:
    """Graph of a sentence. Nodes are in the order motion, actions, specifics, each by first mention in a frame."""

    text: str
    words: tuple[str, ...]
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    cut: Cut = field(default_factory=Cut)

    def level(self, level: str) -> tuple[Node, ...]:
        """The nodes of one level, in order."""
        return tuple(node for node in self.nodes if node.level == level)

    def slots(self, max_actions: int, max_specifics: int) -> list[int]:
        """Index of the node in each slot, or -1. Slot 0 is the motion, then actions, then specifics: S = 1 + A + P."""
        actions = [n.id for n in self.level("action")][:max_actions]
        specifics = [n.id for n in self.level("specific")][:max_specifics]
        return [0, *actions, *[-1] * (max_actions - len(actions)), *specifics, *[-1] * (max_specifics - len(specifics))]

    def adjacency(self, max_actions: int, max_specifics: int) -> NDArray[np.int64]:
        """Edge type between slots, (S, S), -1 where there is none; undirected.

        Every real node has a self-loop, else a lone motion node has no neighbour to attend to. As in GraphMotion
        the motion's counts as `MA`, the others' as `OTHERS`.
        """
        slots = self.slots(max_actions, max_specifics)
        position = {node: slot for slot, node in enumerate(slots) if node >= 0}
        adjacency = np.full((len(slots), len(slots)), -1, dtype=np.int64)
        for node, slot in position.items():
            adjacency[slot, slot] = MA if node == 0 else OTHERS
        for edge in self.edges:
            if edge.source in position and edge.target in position:
                source, target = position[edge.source], position[edge.target]
                adjacency[source, target] = adjacency[target, source] = EDGE_TYPES.index(edge.type)
        return adjacency

    def to_json(self) -> dict[str, Any]:
        """Encode the graph for `from_json`; stored with the features of a prompt."""
        return {
            "text": self.text,
            "words": list(self.words),
            "nodes": [{"id": n.id, "level": n.level, "text": n.text, "words": list(n.words)} for n in self.nodes],
            "edges": [{"from": e.source, "to": e.target, "type": e.type, "role": e.role} for e in self.edges],
            "cut": {
                "actions": list(self.cut.actions),
                "specifics": list(self.cut.specifics),
                "edges": self.cut.edges,
            },
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> SemanticGraph:
        """Read the output of `to_json`. Raises KeyError, TypeError or ValueError for anything else."""
        cut = data["cut"]
        graph = cls(
            text=str(data["text"]),
            words=tuple(str(w) for w in data["words"]),
            nodes=tuple(
                Node(int(n["id"]), str(n["level"]), str(n["text"]), tuple(int(w) for w in n["words"]))
                for n in data["nodes"]
            ),
            edges=tuple(Edge(int(e["from"]), int(e["to"]), str(e["type"]), str(e["role"])) for e in data["edges"]),
            cut=Cut(tuple(cut["actions"]), tuple(cut["specifics"]), int(cut["edges"])),
        )
        graph.validate()
        return graph

    def validate(self) -> None:
        """Raise ValueError unless levels, identifiers, words and edges fit together."""
        levels = [LEVELS.index(node.level) for node in self.nodes]
        if levels[:1] != [0] or levels.count(0) != 1 or levels != sorted(levels):
            raise ValueError("a graph has one motion node, then actions, then specifics")
        if [node.id for node in self.nodes] != list(range(len(self.nodes))):
            raise ValueError("nodes are numbered from 0 in order")
        if any(not 0 <= w < len(self.words) for node in self.nodes for w in node.words):
            raise ValueError("a node names a word that is not there")
        for edge in self.edges:
            if edge.type not in EDGE_TYPES:
                raise ValueError(f"{edge.type!r} is not an edge type")
            if not (0 <= edge.source < len(levels) and 0 <= edge.target < len(levels)):
                raise ValueError("an edge names a node that is not there")
            if levels[edge.target] != levels[edge.source] + 1:
                raise ValueError("edges run motion to action and action to specific")


def build_graph(text: str, frames: Sequence[Frame], *, max_actions: int, max_specifics: int) -> SemanticGraph:
    """Build the graph of a sentence from its predicate frames.

    Arguments with the same span merge into one node with several edges (GraphMotion repeats them for each verb,
    which fills its eight slots with the same subject). Frames fill the slots in order; `cut` says what was left
    out. Specifics that only a cut action mentions go with it.

    Args:
        text: the sentence; its words are those between whitespace.
        frames: from a `RoleLabeller`, predicates as word indices of `text.split()`.
        max_actions, max_specifics: the bundle's caps (paper 4 / 8, starter 8 / 16).
    """
    words = tuple(text.split())
    kept, dropped = frames[:max_actions], frames[max_actions:]
    nodes = [Node(0, "motion", text, tuple(range(len(words))))]
    edges: list[Edge] = []
    for frame in kept:
        nodes.append(Node(len(nodes), "action", words[frame.predicate], (frame.predicate,)))
        edges.append(Edge(0, nodes[-1].id, "MA", "MA"))
    spans: dict[tuple[int, int], int] = {}
    cut_spans: dict[tuple[int, int], None] = {}
    cut_edges = sum(1 + len(frame.arguments) for frame in dropped)
    for action, frame in enumerate(kept, start=1):
        for argument in frame.arguments:
            span = (argument.start, argument.stop)
            if span not in spans:
                if len(spans) == max_specifics:
                    cut_spans[span] = None
                    cut_edges += 1
                    continue
                spans[span] = len(nodes)
                nodes.append(Node(len(nodes), "specific", " ".join(words[slice(*span)]), argument.words))
            edges.append(Edge(action, spans[span], edge_type(argument.role), argument.role))
    for frame in dropped:
        cut_spans.update({(a.start, a.stop): None for a in frame.arguments if (a.start, a.stop) not in spans})
    cut = Cut(
        actions=tuple(words[frame.predicate] for frame in dropped),
        specifics=tuple(" ".join(words[slice(*span)]) for span in cut_spans),
        edges=cut_edges,
    )
    return SemanticGraph(text, words, tuple(nodes), tuple(edges), cut)
