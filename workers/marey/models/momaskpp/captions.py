"""Word-level states of the captions of a prepared folder: encoded once, then mapped from two files beside its texts.

`words.npy`: float16 (R, W), the states of all different captions one after another. `words.npz`: `start` int64
(U + 1,), rows of each of them · `caption` int64 (K,), which of them each caption is · `key`: of captions, encoder and
limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import structlog
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.core.arrays import check_array, map_npy, read_npz, text_of
from marey.core.errors import InvalidFile, NotFound
from marey.core.whole_files import whole_file
from marey.data.manifest import CLIPS
from marey.data.prepared import PreparedData
from marey.models.momaskpp.config import TextConfig
from marey.models.momaskpp.model import TextStates
from marey.nn import distributed
from marey.text.encoders import TextEncoder, encoder_sha256
from marey.text.loading import load_encoder
from marey.text.pipeline import refuse_mismatch
from marey.text.truncation import truncated_tokens
from marey.training.sentences import SentenceData, text_statistics
from marey.training.texts import CaptionTexts

log = structlog.get_logger()

STATES, INDEX = "words.npy", "words.npz"
CHUNK = 256
MAX_BYTES = 2**30
SAMPLED = 4096
"""Captions that the statistics of states are taken from."""


@dataclass(frozen=True)
class WordData:
    """Captions as sentences and as words; caption numbers are those of `SentenceData`."""

    sentences: SentenceData
    states: NDArray[np.float16]  # (R, W), mapped
    start: NDArray[np.int64]  # (U + 1,)
    caption: NDArray[np.int64]  # (K,)
    limit: int

    @classmethod
    def load(cls, prepared: PreparedData, config: TextConfig, device: torch.device) -> WordData:
        """Read the states of a prepared folder; encode its captions where there are none yet, or others.

        Raises:
            NotFound: captions have no text features (`marey data text`), or their encoder is not installed.
            InvalidFile: texts of another width, or damaged files.
            InvalidBundle: another version of the encoder is installed than the texts were made with.
        """
        texts = CaptionTexts.load(prepared)
        sentences = SentenceData.of_sentences(texts, prepared.caption_counts, config.width, device)
        sha256 = encoder_sha256(texts.spec.encoder)
        refuse_mismatch("encoder", texts.spec.encoder, texts.spec.encoder_sha256, texts.spec.encoder, sha256)
        key = f"{prepared.manifest.files[CLIPS].sha256}:{sha256}:{config.max_words}"
        if _key_of(prepared.path) != key:
            if distributed.rank() == 0:
                captions = [text for clip in prepared.clips for text in clip.all_captions]
                _write(prepared.path, captions, load_encoder(texts.spec.encoder), config, key)
            distributed.broadcast(torch.zeros(1, device=device))  # the others wait for the files
        return cls(sentences, *_read(prepared.path, config.width, len(sentences.sentence)), config.max_words)

    def words(self, captions: Tensor, size: int | None = None) -> TextStates:
        """Return the states of captions (B,), padded to `size` words or to the longest of them."""
        chosen = self.caption[captions.cpu().numpy()]
        parts = [self.states[self.start[text] : self.start[text + 1]] for text in chosen]
        longest = max(map(len, parts)) if size is None else size
        padded = np.zeros((len(parts), longest, self.states.shape[1]), np.float32)
        for row, part in enumerate(parts):
            padded[row, : len(part)] = part
        present = np.arange(longest)[None] < np.array([len(part) for part in parts])[:, None]
        device = captions.device
        return TextStates(torch.from_numpy(padded).to(device), torch.from_numpy(present).to(device))

    def statistics(self, clips: Sequence[int]) -> tuple[Tensor, Tensor]:
        """Return mean and std (W,) of the states of captions of `clips`, from some thousands of them."""
        captions = self.sentences.captions_of(clips).cpu().numpy()
        some = np.random.default_rng(0).permutation(captions)[:SAMPLED]
        texts = self.caption[some]
        rows = np.concatenate([self.states[self.start[t] : self.start[t + 1]] for t in texts]).astype(np.float64)
        std = rows.std(0).clip(1e-4)
        return torch.from_numpy(rows.mean(0)).float(), torch.from_numpy(std).float()

    def sentence_statistics(self, clips: Sequence[int]) -> tuple[Tensor, Tensor]:
        """Return mean and std (W,) of the sentences of captions of `clips`."""
        return text_statistics(self.sentences.strings, self.sentences.sentence[self.sentences.captions_of(clips)])


def _write(folder: Path, captions: Sequence[str], encoder: TextEncoder, config: TextConfig, key: str) -> None:
    """Write both files, the index last."""
    unique = list(dict.fromkeys(captions))
    log.info("encoding captions word by word", captions=len(unique), encoder=encoder.name)
    (folder / INDEX).unlink(missing_ok=True)
    found: list[NDArray[np.float16]] = []
    for at in range(0, len(unique), CHUNK):
        states = truncated_tokens(encoder, unique[at : at + CHUNK], config.max_words)
        found += [each.astype(np.float16) for each in states]
    number = {text: i for i, text in enumerate(unique)}
    start = np.concatenate([[0], np.cumsum([len(each) for each in found])]).astype(np.int64)
    with whole_file(folder / STATES, alone=True) as part, part.open("wb") as file:
        np.save(file, np.concatenate(found))
    with whole_file(folder / INDEX, alone=True) as part, part.open("wb") as file:
        np.savez(file, start=start, caption=np.array([number[text] for text in captions], np.int64), key=np.array(key))


def _key_of(folder: Path) -> str | None:
    """Return the key of the files of a prepared folder; None where there are none."""
    try:
        arrays = read_npz(folder / INDEX, ("key",), limit=MAX_BYTES, hint="Remove it.")
    except NotFound:
        return None
    return text_of(arrays["key"], "key", str(folder / INDEX))


def _read(folder: Path, width: int, captions: int) -> tuple[NDArray[np.float16], NDArray[np.int64], NDArray[np.int64]]:
    where, hint = str(folder / INDEX), "Remove it."
    arrays = read_npz(folder / INDEX, ("start", "caption"), limit=MAX_BYTES, hint=hint)
    start, caption = arrays["start"], arrays["caption"]
    check_array(start, "start", where, kinds="int64", shape=(None,), hint=hint)
    check_array(caption, "caption", where, kinds="int64", shape=(captions,), hint=hint)
    states = map_npy(folder / STATES, hint=hint)
    check_array(states, "states", str(folder / STATES), kinds="float16", shape=(None, width), hint=hint)
    if start[0] != 0 or start[-1] != len(states) or (np.diff(start) < 1).any():
        raise InvalidFile("`start` does not cover all states", where=where, hint=hint)
    if caption.min() < 0 or caption.max() >= len(start) - 1:
        raise InvalidFile("`caption` names a text that is not there", where=where, hint=hint)
    return states, start, caption
