"""Captions of a set in other words, by a language model: an author beside those of the set (SnapMoGen App. C, Tab. 5).

Each caption is rephrased a few times. An answer counts only if it names the sides, directions and counts of the
caption, and, where the words of both name actions of the vocabulary, the same ones in the same order.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from marey.core.errors import InvalidInput, Unreachable
from marey.data.caption_files import COLUMNS
from marey.data.index import SEPARATOR, UNUSED
from marey.data.prepare import CaptureSet
from marey.motion.files import write_atomically
from marey.text.guard import changed_details
from marey.text.rewriters import NotRewritten, PromptRewriter
from marey.vocabulary.scope import ActionLists, match_scope

FILE = "captions-paraphrases.csv"
CLIPS_AT_ONCE = 16
"""Clips whose captions are asked for together; the file is written after each of these batches."""


@dataclass(frozen=True)
class Paraphrased:
    """Result of a call.

    Attributes:
        path: the file of captions.
        clips: clips that have paraphrases now.
        written: paraphrases that were added.
        refused: why answers were not used, and how many.
    """

    path: Path
    clips: int
    written: int
    refused: Mapping[str, int]


def paraphrase(
    folder: Path, rewriters: Sequence[PromptRewriter], progress: Callable[[int, int], None] = lambda done, total: None
) -> Paraphrased:
    """Write `captions-paraphrases.csv` beside the index of a set; clips that it has already are left as they are.

    Args:
        folder: with `dataset.toml`, `index.csv` and perhaps captions by authors.
        rewriters: each gives one paraphrase of every caption.
        progress: called with clips done and clips in all.

    Raises:
        NotFound, InvalidFile: of the folder.
        InvalidInput: no clip has captions.
        Unreachable: the language model gave no usable answer to a whole batch; what was written before it stays.
    """
    captures = CaptureSet.own(folder)
    told = _captions_by_people(captures)
    if not told:
        raise InvalidInput("no clip has captions to rephrase", where=str(folder), hint="Write some into index.csv.")
    done = dict(next((file.captions for file in captures.caption_files if file.name == FILE), {}))
    missing = [clip for clip in told if clip not in done]
    refused, written, path = Counter[str](), 0, folder / FILE
    for start in range(0, len(missing), CLIPS_AT_ONCE):
        batch = missing[start : start + CLIPS_AT_ONCE]
        for rewriter in rewriters:
            rewriter.prefetch([text for clip in batch for text in told[clip]])
        found = {clip: list(_of_clip(told[clip], rewriters, refused)) for clip in batch}
        if not any(found.values()):
            reason, _ = refused.most_common(1)[0]
            raise Unreachable(
                f"gave no usable answer: {reason}",
                where="MAREY_REWRITER_URL",
                hint="Call the command again: it goes on where it stopped.",
            )
        done |= {clip: tuple(texts) for clip, texts in found.items() if texts}
        written += sum(map(len, found.values()))
        write_atomically(path, _as_csv(done).encode())
        progress(len(told) - len(missing) + start + len(batch), len(told))
    return Paraphrased(path, len(done), written, refused)


def _captions_by_people(captures: CaptureSet) -> dict[str, tuple[str, ...]]:
    """Return the captions of each clip that is used, without paraphrases of earlier calls."""
    by_people = replace(captures, caption_files=tuple(file for file in captures.caption_files if file.name != FILE))
    return {
        row.id: tuple(dict.fromkeys(chain(*authors)))
        for row in captures.rows
        if row.action != UNUSED and (authors := by_people.captions_of(row))
    }


def _of_clip(captions: Sequence[str], rewriters: Sequence[PromptRewriter], refused: Counter[str]) -> Iterator[str]:
    """Yield the different paraphrases of the captions of a clip that may be used, and count the others by reason."""
    seen = {text.casefold() for text in captions}
    for caption in captions:
        for rewriter in rewriters:
            try:
                text = rewriter.rewrite(caption).text
            except NotRewritten as error:
                refused[error.message] += 1
                continue
            if reason := _unusable(caption, text):
                refused[reason] += 1
            elif text.casefold() in seen:
                refused["it says the same words"] += 1
            else:
                seen.add(text.casefold())
                yield text


def _unusable(caption: str, text: str) -> str | None:
    """Return why a paraphrase may not stand for its caption; None if it may."""
    if SEPARATOR in text:
        return f"it has a {SEPARATOR}, which separates captions"
    if reason := changed_details(caption, text):
        return reason
    was, now = _actions(caption), _actions(text)
    if was and now and was != now:
        return f"it changes the actions: {', '.join(was)} became {', '.join(now)}"
    return None


def _actions(text: str) -> tuple[str, ...]:
    """Return the actions of the vocabulary that the words of a text name, in their order; empty if none."""
    return tuple(each.action for each in match_scope(text, ActionLists(())).actions if each.action is not None)


def _as_csv(captions: Mapping[str, Sequence[str]]) -> str:
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows((clip, f" {SEPARATOR} ".join(texts)) for clip, texts in captions.items())
    return table.getvalue()
