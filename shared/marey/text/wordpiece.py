"""Word pieces of given words, as AllenNLP's reader made them: punctuation inside a word is not split off first."""

from __future__ import annotations

from collections.abc import Sequence

CLS, SEP, UNKNOWN = "[CLS]", "[SEP]", "[UNK]"
MAX_CHARACTERS = 100


class WordPieces:
    """Greedy longest-match word pieces (BERT's `WordpieceTokenizer`)."""

    def __init__(self, vocabulary: Sequence[str], *, lowercase: bool) -> None:
        self._ids = {piece: index for index, piece in enumerate(vocabulary)}
        self._lowercase = lowercase
        self._cls, self._sep, self._unknown = (self._ids[piece] for piece in (CLS, SEP, UNKNOWN))

    def encode(self, words: Sequence[str]) -> tuple[list[int], list[int], list[int]]:
        """Ids with [CLS] and [SEP]; position of each word's first piece; for each piece its word (-1: special)."""
        ids, owners = [self._cls], [-1]
        starts: list[int] = []
        for index, word in enumerate(words):
            pieces = self._split(word.lower() if self._lowercase else word)
            starts.append(len(ids))
            ids += pieces
            owners += [index] * len(pieces)
        return [*ids, self._sep], starts, [*owners, -1]

    def _split(self, word: str) -> list[int]:
        if len(word) > MAX_CHARACTERS:
            return [self._unknown]
        pieces: list[int] = []
        start = 0
        while start < len(word):
            prefix = "##" if start else ""
            stop = next((s for s in range(len(word), start, -1) if prefix + word[start:s] in self._ids), None)
            if stop is None:
                return [self._unknown]
            pieces.append(self._ids[prefix + word[start:stop]])
            start = stop
        return pieces
