"""Caption files of HumanML3D, KIT-ML and sets in their form: `caption#word/TAG word/TAG …#start#end`, a caption a line.

The tags are parts of speech, made by the authors of the set with spaCy. `start` and `end` are seconds; both are 0 where
the caption is of the whole clip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from marey.core.errors import InvalidFile


@dataclass(frozen=True)
class TaggedCaption:
    """A caption.

    Attributes:
        text: the sentence, words one space apart.
        tags: its words with their parts of speech, `word/TAG word/TAG …`; empty if it has none.
        start, end: seconds of the clip that it is of; both 0 for all of it.
    """

    text: str
    tags: str
    start: float
    end: float

    @property
    def whole(self) -> bool:
        """Return True if it is of the whole clip."""
        return self.start == 0 and self.end == 0


def read_caption(line: str, *, where: str) -> TaggedCaption:
    """Read a line. A time that is no number is 0, as in the public code.

    Raises:
        InvalidFile: it is not `caption#word/TAG …#start#end`.
    """
    fields = line.strip().rsplit("#", 3)
    message = "is not a line `caption#word/TAG …#start#end`"
    if len(fields) != 4 or not fields[0].strip():
        raise InvalidFile(message, where=where)
    words = fields[1].split()
    parted = (word.rpartition("/") for word in words)
    if not all(word and tag for word, _, tag in parted):
        raise InvalidFile(message, where=where)
    try:
        start, end = (float(value) for value in fields[2:])
    except ValueError:
        raise InvalidFile(message, where=where) from None
    start, end = (0.0 if math.isnan(value) else value for value in (start, end))
    if not (math.isfinite(start) and math.isfinite(end)) or min(start, end) < 0:
        raise InvalidFile(f"{message}: the times are {start:g} and {end:g}", where=where)
    return TaggedCaption(" ".join(fields[0].split()), " ".join(words), start, end)
