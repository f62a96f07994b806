"""The public T2M evaluator (Guo et al. 2022): Euclidean distance between embeddings of 512 numbers.

It has never run with the public weights, which were not available during development. It is tested with random weights
under the public names and shapes, against the networks written out step by step. To compare first, once there are
weights: the ground-truth row of HumanML3D's test split, R@1 .511, R@2 .703, R@3 .797, matching score 2.974, diversity
9.503.

The public code returns embeddings sorted by motion length; here they have the order of the input.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle, InvalidInput
from marey.evaluator.metrics.retrieval import Distance
from marey.evaluator.networks import LoadedNetworks, open_networks
from marey.evaluator.port import Embeddings, Motion, check_motions
from marey.evaluator.t2m_model import FRAMES, T2MConfig, T2MMotionEncoder, T2MTextEncoder
from marey.evaluator.t2m_words import END, START, TAGS, UNKNOWN, Tagger, WordVectors
from marey.nn.devices import choose_device

MODEL = "t2m"
WORDS_FILE, WORDS_PART = "words.json", "words"
BATCH = 32


class T2MEvaluator(LoadedNetworks[T2MConfig, T2MMotionEncoder, T2MTextEncoder]):
    """A loaded bundle, as `marey.evaluator.t2m_import` writes it. Not thread-safe."""

    distance: Distance = "euclidean"

    def __init__(
        self,
        bundle: Bundle,
        config: T2MConfig,
        motion: T2MMotionEncoder,
        text: T2MTextEncoder,
        words: WordVectors,
        device: torch.device,
        tagger: Tagger | None,
    ) -> None:
        """Create an evaluator from its parts; most callers use `load`."""
        super().__init__(bundle, config, motion, text, device)
        self.words, self.tagger = words, tagger

    @classmethod
    def load(cls, bundle: Bundle, *, device: str = "auto", tagger: Tagger | None = None) -> T2MEvaluator:
        """Load a bundle.

        Args:
            bundle: a verified bundle.
            device: `auto`, `cpu`, `cuda`, `cuda:N`.
            tagger: source of parts of speech; motions can be embedded without.

        Raises:
            InvalidBundle: not this evaluator, or damaged.
            InvalidInput: unknown device.
        """
        config, motion, text = open_networks(bundle, MODEL, T2MConfig.from_dict, T2MMotionEncoder, T2MTextEncoder)
        return cls(bundle, config, motion, text, _words(bundle, config), choose_device(device), tagger)

    @torch.inference_mode()
    def embed_motion(self, motions: Sequence[Motion]) -> Embeddings:
        """See `Evaluator`; motions of 4 to 196 frames; the last one to three are not read if they are no complete step
        of four."""
        check_motions(motions, self.config.features, self.config.min_frames, FRAMES)
        found = np.zeros((len(motions), self.width), np.float32)
        for low in range(0, len(motions), BATCH):
            part = [torch.from_numpy(np.ascontiguousarray(m, np.float32)) for m in motions[low : low + BATCH]]
            lengths = torch.tensor([len(each) for each in part], device=self.device)
            features = torch.nn.utils.rnn.pad_sequence(part, batch_first=True).to(self.device)
            found[low : low + len(part)] = self.motion(features, lengths).cpu().numpy()
        return found

    @torch.inference_mode()
    def embed_text(self, sentences: Sequence[str]) -> Embeddings:
        """See `Evaluator`; sentences whose parts of speech the tagger knows, the first 20 words of each."""
        tagger = self.tagger
        if tagger is None:
            raise InvalidInput(
                "reads words with parts of speech, and was loaded without a tagger",
                where=self.name,
                hint="Load it with the folder of HumanML3D's caption files.",
            )
        found = np.zeros((len(sentences), self.width), np.float32)
        for low in range(0, len(sentences), BATCH):
            read = [self.words.read(tagger.tag(sentence)) for sentence in sentences[low : low + BATCH]]
            lengths = torch.tensor([len(vectors) for vectors, _ in read])
            words, tags = (
                torch.nn.utils.rnn.pad_sequence([torch.from_numpy(each[k]) for each in read], batch_first=True)
                for k in range(2)
            )
            embedded = self.text.embed(words.to(self.device), tags.to(self.device), lengths)
            found[low : low + len(read)] = embedded.cpu().numpy()
        return found


def _words(bundle: Bundle, config: T2MConfig) -> WordVectors:
    words, vectors = bundle.read_json(WORDS_FILE), bundle.tensors(WORDS_PART)["vectors"].astype(np.float32)
    fits = isinstance(words, list) and vectors.shape == (len(words), config.word_width) and len(TAGS) == config.tags
    if not fits or not {START, END, UNKNOWN} <= set(words):
        raise InvalidBundle("its words do not fit their vectors", where=str(bundle.path))
    return WordVectors({word: row for row, word in enumerate(words)}, vectors)
