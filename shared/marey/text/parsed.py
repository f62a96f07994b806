"""A parsed prompt for display: prompt, parsed text, reason for a difference, graph, warnings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from marey.text.graph import SemanticGraph
from marey.text.words import EDGE_PUNCTUATION

NO_ACTION = (
    "no action found: the model reads the prompt as one sentence without actions; "
    "write what the person does with a verb, as in 'a person walks'"
)


@dataclass(frozen=True)
class ParsedPrompt:
    """A prompt and the graph that it becomes."""

    prompt: str
    graph: SemanticGraph
    """Of the text that the model reads, `graph.text`: the prompt, or the prompt rewritten."""
    rewrite_reason: str | None
    """Why the text differs from the prompt, or why a rewrite was not used; None where no rewrite was asked for."""
    warnings: tuple[str, ...]
    movements: tuple[str, ...] = ()
    """Texts of its movements in the order of time, if it asks for several; a model that makes sequences reads these in
    place of `graph.text`."""

    def to_json(self) -> dict[str, Any]:
        """The line of `marey text parse --json`, and an item of `POST /v1/texts/parse`.

        Texts of nodes come without the punctuation at their ends, as the encoder reads them; `words` stay the words
        between whitespace.
        """
        graph = self.graph.to_json()
        for node in graph["nodes"]:
            node["text"] = without_punctuation(node["text"])
        for name in ("actions", "specifics"):
            graph["cut"][name] = [without_punctuation(text) for text in graph["cut"][name]]
        return {
            "prompt": self.prompt,
            "text": graph.pop("text"),
            "rewrite_reason": self.rewrite_reason,
            "movements": list(self.movements),
            "warnings": list(self.warnings),
            **graph,
        }


def warnings_of(graph: SemanticGraph) -> tuple[str, ...]:
    """Return notes for the author of a prompt about its graph."""
    if not graph.level("action") and not graph.cut.actions:
        return (NO_ACTION,)
    warnings: list[str] = []
    for name, texts in (("action", graph.cut.actions), ("detail", graph.cut.specifics)):
        if texts:
            shown = ", ".join(repr(without_punctuation(text)) for text in texts)
            warnings.append(f"{len(texts)} {name}{'s' if len(texts) > 1 else ''} over the model's limit: {shown}")
    return tuple(warnings)


def without_punctuation(text: str) -> str:
    """Strip punctuation at the ends: "left." and "left" are one word (a text of dots stays unchanged)."""
    return text.strip(EDGE_PUNCTUATION + " ") or text
