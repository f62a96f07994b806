"""Captions of all clips as semantic graphs in fixed slots, on one device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from marey.core.errors import InvalidInput
from marey.models.hgm3.conditions import LEVELS, GraphBatch, TextNormalizer
from marey.models.hgm3.config import ConditionConfig, HGM3Config
from marey.training.sentences import SentenceData, sentence_fields, text_statistics
from marey.training.texts import CaptionTexts


@dataclass(frozen=True)
class CaptionData(SentenceData):
    """Captions with their graphs."""

    slots: Tensor  # (K, S) int32 string of each slot, -1 = absent
    adjacency: Tensor  # (K, S, S) int8

    @classmethod
    def of(
        cls, texts: CaptionTexts, counts: Sequence[Sequence[int]], config: ConditionConfig, device: torch.device
    ) -> CaptionData:
        """Put the captions' graphs into slots; `counts` are captions of each whole clip by each author.

        Raises:
            InvalidFile: texts of another encoder's width.
        """
        slots, adjacency = texts.slots(config.max_actions, config.max_specifics)
        return cls(
            **sentence_fields(texts, counts, config.text_width, device),
            slots=torch.from_numpy(slots.astype(np.int32)).to(device),
            adjacency=torch.from_numpy(adjacency.astype(np.int8)).to(device),
        )

    def graphs(self, captions: Tensor) -> GraphBatch:
        """Return the graphs of captions (B,)."""
        slots = self.slots[captions].long()
        present = slots >= 0
        nodes = self.strings[slots.clamp(min=0)].float() * present[..., None]
        return GraphBatch(nodes, self.adjacency[captions].long(), present)

    def standardise(self, normalizer: TextNormalizer, clips: Sequence[int], config: ConditionConfig) -> None:
        """Fit a normalizer to the captions of `clips`, unless the configuration reads the encoder's features as they
        are."""
        if config.standardised:
            mean, std = self.statistics(clips, config)
            normalizer.mean.copy_(mean)
            normalizer.std.copy_(std)

    def statistics(self, clips: Sequence[int], config: ConditionConfig) -> tuple[Tensor, Tensor]:
        """Return mean and std (3, W) of the texts of motion, action and specific nodes over captions of `clips`."""
        slots = self.slots[self.captions_of(clips)].long()  # (R, S)
        ends = [0, 1, 1 + config.max_actions, config.slots]
        levels = [slots[:, ends[level] : ends[level + 1]] for level in range(LEVELS)]
        found = [text_statistics(self.strings, index[index >= 0]) for index in levels]
        return torch.stack([mean for mean, _ in found]), torch.stack([std for _, std in found])


def check_texts(texts: CaptionTexts, config: HGM3Config) -> None:
    """Refuse captions that were read otherwise than the bundle will read prompts.

    Raises:
        InvalidInput: in another order of actions, or cut to fewer nodes than the configuration has.
    """
    spec, condition = texts.spec, config.condition
    if spec.in_order != config.in_order:
        wanted = "without" if config.in_order else "with"
        raise InvalidInput(
            f"the captions are read {'in the order of time' if spec.in_order else 'as written'}, prompts would not be",
            where="in_order",
            hint=f"Run `marey data text` again, {wanted} --as-written, or set in_order in the configuration.",
        )
    if spec.max_actions < condition.max_actions or spec.max_specifics < condition.max_specifics:
        raise InvalidInput(
            f"the captions are cut to {spec.max_actions} actions and {spec.max_specifics} specifics; the configuration "
            f"has {condition.max_actions} and {condition.max_specifics}",
            where="condition",
            hint="Run `marey data text` again without --model.",
        )
