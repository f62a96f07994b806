"""Text features of prompts to the fixed slots of a batch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from shared.errors import InvalidInput
from shared.text.features import TextFeatures
from workers.hgm3.config import ConditionConfig
from workers.hgm3.model import GraphBatch


def graph_batch(texts: Sequence[TextFeatures], config: ConditionConfig, device: torch.device) -> GraphBatch:
    """Put nodes into slots: motion 0, then actions, then specifics; what is absent is zero.

    Raises:
        InvalidInput: features of another encoder's width.
    """
    size = config.slots
    nodes = np.zeros((len(texts), size, config.text_width), np.float32)
    adjacency = np.full((len(texts), size, size), -1, np.int64)
    present = np.zeros((len(texts), size), bool)
    for row, text in enumerate(texts):
        if text.nodes.shape[1] != config.text_width:
            raise InvalidInput(
                f"text features are {text.nodes.shape[1]} wide, this bundle reads {config.text_width}",
                where=text.prompt[:60],
                hint="They come from another encoder. Parse the prompt again for this bundle.",
            )
        slots = np.array(text.graph.slots(config.max_actions, config.max_specifics))
        present[row] = slots >= 0
        nodes[row, present[row]] = text.nodes[slots[present[row]]]
        adjacency[row] = text.graph.adjacency(config.max_actions, config.max_specifics)
    return GraphBatch(
        torch.from_numpy(nodes).to(device), torch.from_numpy(adjacency).to(device), torch.from_numpy(present).to(device)
    )
