"""Words as the public T2M evaluator reads them: GloVe vectors and parts of speech.

The tags come with HumanML3D's captions (spaCy's, made by its authors: `caption#word/TAG word/TAG …#start#end`); some
words have tags of their own, which take precedence. Vectors and lists: `EricGuo5513/momask-codes` (MIT),
utils/word_vectorizer.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidFile, InvalidInput
from marey.data.prepared import PreparedData
from marey.data.t2m_captions import read_caption

TAGS = (
    "VERB", "NOUN", "DET", "ADP", "NUM", "AUX", "PRON", "ADJ", "ADV",
    "Loc_VIP", "Body_VIP", "Obj_VIP", "Act_VIP", "Desc_VIP", "OTHER",
)  # fmt: skip
OTHER = TAGS.index("OTHER")
_OWN = {
    "Loc_VIP": "left right clockwise counterclockwise anticlockwise forward back backward up down straight curve",
    "Body_VIP": "arm chin foot feet face hand mouth leg waist eye knee shoulder thigh",
    "Obj_VIP": "stair dumbbell chair window floor car ball handrail baseball basketball",
    "Act_VIP": """walk run swing pick bring kick put squat throw hop dance jump turn stumble stop sit lift lower raise
    wash stand kneel stroll rub bend balance flap jog shuffle lean rotate spin spread climb""",
    "Desc_VIP": "slowly carefully fast careful slow quickly happy angry sad happily angrily sadly",
}
OWN_TAGS = {word: TAGS.index(tag) for tag, words in _OWN.items() for word in words.split()}
MAX_WORDS = 20
START, END, UNKNOWN = "sos", "eos", "unk"

Tagged = Sequence[tuple[str, str]]
"""Words (base forms) with their tags."""


class Tagger(Protocol):
    """Interface of taggers: words and part-of-speech tags of a sentence."""

    def tag(self, sentence: str) -> Tagged:
        """Return words and tags, in order.

        Raises:
            InvalidInput: the tags are unknown.
        """
        ...


@dataclass(frozen=True)
class TaggedCaptions:
    """Tags of known captions: the only ones with which numbers are comparable to published ones.

    There is no tagger for other sentences: published numbers used spaCy's tags, and another tagger's would silently
    give other embeddings.
    """

    found: Mapping[str, Tagged]

    @classmethod
    def read(cls, folder: Path) -> TaggedCaptions:
        """Read all captions of a folder of HumanML3D's (or KIT-ML's) `texts/*.txt`.

        Raises:
            InvalidFile: a line is not `caption#words#start#end`, or there are none.
        """
        captions = (
            read_caption(line, where=f"{file}:{number}")
            for file in sorted(folder.glob("*.txt"))
            for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1)
            if line.strip()
        )
        return cls._of(((caption.text, caption.tags) for caption in captions), str(folder))

    @classmethod
    def of(cls, data: PreparedData) -> TaggedCaptions:
        """Return the captions of a prepared folder that was made from a published one.

        Raises:
            InvalidFile: it has no tags.
        """
        captions = (pair for clip in data.clips if clip.tags for pair in zip(clip.captions, clip.tags, strict=True))
        return cls._of(captions, str(data.path))

    @classmethod
    def _of(cls, captions: Iterable[tuple[str, str]], where: str) -> TaggedCaptions:
        found: dict[str, Tagged] = {}
        for text, tags in captions:
            if tags:
                found.setdefault(text, read_tags(tags))
        if not found:
            hint = "Give HumanML3D's folder `texts`, or one that `marey data prepare humanml3d` wrote."
            raise InvalidFile("holds no captions with parts of speech", where=where, hint=hint)
        return cls(found)

    def tag(self, sentence: str) -> Tagged:
        """See `Tagger`."""
        words = self.found.get(" ".join(sentence.split()))
        if words is None:
            raise InvalidInput(
                "is not one of the captions whose words are tagged",
                where=sentence[:60],
                hint="The T2M evaluator reads the data set's own captions; choose another evaluator for other prompts.",
            )
        return words


def read_tags(tags: str) -> Tagged:
    """Split `word/TAG word/TAG …`."""
    parted = (word.rpartition("/") for word in tags.split())
    return tuple((word, tag) for word, _, tag in parted)


@dataclass(frozen=True, eq=False)
class WordVectors:
    """GloVe vectors of a vocabulary."""

    words: Mapping[str, int]
    vectors: NDArray[np.float32]  # (V, 300)

    def read(self, tagged: Tagged) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return vectors (S, 300) and one-hot tags (S, 15) of a sentence between its start and its end, at most 20 + 2.

        An unknown word loses its tag too; a word of `OWN_TAGS` has that one, an unknown tag is OTHER.
        """
        sentence = [(START, "OTHER"), *tagged[:MAX_WORDS], (END, "OTHER")]
        vectors = np.stack([self.vectors[self.words.get(word, self.words[UNKNOWN])] for word, _ in sentence])
        tags = np.zeros((len(sentence), len(TAGS)), np.float32)
        for place, (word, tag) in enumerate(sentence):
            named = OWN_TAGS.get(word, TAGS.index(tag) if tag in TAGS else OTHER)
            tags[place, named if word in self.words else OTHER] = 1
        return vectors, tags
