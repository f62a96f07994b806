"""Captions of a prepared folder as text features: `texts.npz`, written once, read by every training run.

Arrays (K captions of C clips, N nodes and E edges of all their graphs, U different node texts):
`strings` float16 (U, W) · `caption_start` int64 (C + 1,) · `node_start` int64 (K + 1,) · `node_string` int32 (N,) ·
`node_level` int8 (N,) · `edge_start` int64 (K + 1,) · `edges` int16 (E, 3): source, target, type, nodes numbered within
their caption · `spec`, `clips_sha256`: strings.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from marey.bundles import TextSpec
from marey.core.arrays import check_array, read_npz, text_of
from marey.core.children import end_with_parent
from marey.core.documents import parse_json
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.core.hashing import sha256_of
from marey.core.validation import first_problem
from marey.core.whole_files import whole_file
from marey.data.manifest import CLIPS, TEXTS
from marey.data.prepared import PreparedData
from marey.text.graph import EDGE_TYPES, LEVELS, MA, OTHERS, SemanticGraph
from marey.text.pipeline import TextPipeline

CHUNK = 256
OTHER_PIPELINE = "captions were read by another encoder or labeller"
READ_AGAIN = "Read all captions again, or choose the encoder and labeller of that folder."
SPECIFIC = LEVELS.index("specific")
MAX_BYTES = 8 * 2**30
KINDS = {
    "strings": "float16",
    "caption_start": "int64",
    "node_start": "int64",
    "node_string": "int32",
    "node_level": "int8",
    "edge_start": "int64",
    "edges": "int16",
}
"""Arrays of the file, in the order of the fields."""


@dataclass(frozen=True)
class KnownCaptions:
    """Captions that were read before.

    Attributes:
        texts: their features.
        rows: the row of each caption in them.
    """

    texts: CaptionTexts
    rows: Mapping[str, int]

    @classmethod
    def load(cls, data: PreparedData) -> KnownCaptions:
        """Read those of a prepared folder.

        Raises:
            NotFound, InvalidFile: as `CaptionTexts.load`.
        """
        captions = (caption for clip in data.clips for caption in clip.all_captions)
        return cls(CaptionTexts.load(data), {caption: row for row, caption in enumerate(captions)})


@dataclass(frozen=True)
class CaptionTexts:
    """Text features of all captions, ordered by clip."""

    spec: TextSpec
    strings: NDArray[np.float16]  # (U, W)
    first: NDArray[np.int64]  # (C + 1,): clip c has captions first[c] … first[c + 1] - 1
    node_start: NDArray[np.int64]
    node_string: NDArray[np.int32]
    node_level: NDArray[np.int8]
    edge_start: NDArray[np.int64]
    edges: NDArray[np.int16]

    @classmethod
    def build(
        cls,
        captions: Sequence[Sequence[str]],
        pipeline: TextPipeline,
        *,
        known: KnownCaptions | None = None,
        processes: int = 1,
        encoder_path: Path | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> CaptionTexts:
        """Parse and encode the captions of each clip; equal texts are encoded once.

        Args:
            captions: captions of each clip.
            pipeline: text pipeline for the single-process case.
            known: captions that were read before; only the others are parsed and encoded. A node's text that both have
                is kept twice.
            processes: number of parallel processes, each with the weights of its `spec`.
            encoder_path: folder of the encoder's weights in those processes; None = where they are installed.
            progress: called with the number of done captions and of all.

        Raises:
            InvalidInput: `known` was read by another pipeline.
        """
        flat = [caption for clip in captions for caption in clip]
        unique = list(dict.fromkeys(flat))
        if known is not None and known.texts.spec != pipeline.spec:
            raise InvalidInput(OTHER_PIPELINE, where="known", hint=READ_AGAIN)
        row_of = {} if known is None else dict(known.rows)
        unread = [text for text in unique if text not in row_of]
        texts = cls._read(unread, pipeline, processes, encoder_path, progress)
        if known is not None:
            texts = known.texts._with(texts)
        row_of |= {text: row for row, text in enumerate(unread, len(texts.node_start) - 1 - len(unread))}
        return texts._arranged(np.array([row_of[text] for text in flat], np.int64), [len(clip) for clip in captions])

    @classmethod
    def of_known(cls, captions: Sequence[Sequence[str]], known: Sequence[KnownCaptions]) -> CaptionTexts:
        """Return the captions of each clip, all of which were read before; nothing is parsed or encoded.

        Args:
            captions: captions of each clip.
            known: one or several folders' captions.

        Raises:
            InvalidInput: they were read by different pipelines.
        """
        texts, row_of = known[0].texts, dict(known[0].rows)
        for more in known[1:]:
            if more.texts.spec != texts.spec:
                raise InvalidInput(OTHER_PIPELINE, where="known", hint=READ_AGAIN)
            first = len(texts.node_start) - 1
            texts = texts._with(more.texts)
            row_of = {caption: first + row for caption, row in more.rows.items()} | row_of
        rows = np.array([row_of[caption] for clip in captions for caption in clip], np.int64)
        return texts._arranged(rows, [len(clip) for clip in captions])

    @classmethod
    def _read(
        cls,
        unique: Sequence[str],
        pipeline: TextPipeline,
        processes: int,
        encoder_path: Path | None,
        progress: Callable[[int, int], None] | None,
    ) -> CaptionTexts:
        """Read different captions, each as a clip of its own."""
        with _readers(pipeline, processes, encoder_path) as (parse, encode):
            graphs: list[SemanticGraph] = []
            for found in parse(_chunks(unique)):
                graphs += found
                if progress:
                    progress(len(graphs), 2 * len(unique))
            table: dict[str, int] = {}
            node_string = [table.setdefault(n.text, len(table)) for graph in graphs for n in graph.nodes]
            strings: list[NDArray[np.float16]] = [np.zeros((0, pipeline.spec.width), np.float16)]
            for block in encode(_chunks(list(table))):
                strings.append(block)
                if progress:
                    encoded = min((len(strings) - 1) * CHUNK, len(table))
                    progress(len(unique) + encoded * len(unique) // len(table), 2 * len(unique))
        edges = [(e.source, e.target, EDGE_TYPES.index(e.type)) for graph in graphs for e in graph.edges]
        return cls(
            pipeline.spec,
            np.concatenate(strings),
            np.arange(len(unique) + 1),
            _starts([len(graph.nodes) for graph in graphs]),
            np.array(node_string, np.int32),
            np.array([LEVELS.index(n.level) for graph in graphs for n in graph.nodes], np.int8),
            _starts([len(graph.edges) for graph in graphs]),
            np.array(edges, np.int16).reshape(-1, 3),
        )

    def _with(self, more: CaptionTexts) -> CaptionTexts:
        """Return the captions of both, each as a clip of its own."""
        return CaptionTexts(
            self.spec,
            np.concatenate([self.strings, more.strings]),
            np.arange(len(self.node_start) + len(more.node_start) - 1),
            np.concatenate([self.node_start, self.node_start[-1] + more.node_start[1:]]),
            np.concatenate([self.node_string, (more.node_string + len(self.strings)).astype(np.int32)]),
            np.concatenate([self.node_level, more.node_level]),
            np.concatenate([self.edge_start, self.edge_start[-1] + more.edge_start[1:]]),
            np.concatenate([self.edges, more.edges]),
        )

    def _arranged(self, rows: NDArray[np.int64], counts: Sequence[int]) -> CaptionTexts:
        """Return these captions in another order, with the strings they use in the order of their first use.

        Args:
            rows: (K,) caption of each place.
            counts: captions of each clip.
        """
        node_start, nodes = _gathered(self.node_start, rows)
        edge_start, edges = _gathered(self.edge_start, rows)
        used, first, inverse = np.unique(self.node_string[nodes], return_index=True, return_inverse=True)
        order = np.argsort(first)
        place = np.empty(len(used), np.int32)
        place[order] = np.arange(len(used), dtype=np.int32)
        return CaptionTexts(
            self.spec,
            self.strings[used[order]],
            _starts(counts),
            node_start,
            place[inverse],
            self.node_level[nodes],
            edge_start,
            self.edges[edges],
        )

    def save(self, folder: Path) -> None:
        """Write `texts.npz` into a prepared folder."""
        with whole_file(folder / TEXTS, alone=True) as part, part.open("wb") as file:
            np.savez_compressed(
                file,
                strings=self.strings,
                caption_start=self.first,
                node_start=self.node_start,
                node_string=self.node_string,
                node_level=self.node_level,
                edge_start=self.edge_start,
                edges=self.edges,
                spec=np.array(self.spec.model_dump_json()),
                clips_sha256=np.array(sha256_of(folder / CLIPS)),
            )

    @classmethod
    def load(cls, data: PreparedData) -> CaptionTexts:
        """Read the `texts.npz` of a prepared folder.

        Raises:
            NotFound: it does not exist yet.
            InvalidFile: broken, or made for other captions.
        """
        file = data.path / TEXTS
        where, hint = str(file), "Run `marey data text` again."
        try:
            arrays = read_npz(file, ("spec", "clips_sha256", *KINDS), limit=MAX_BYTES, hint=hint)
        except NotFound:
            raise NotFound("captions have no text features yet", where=where, hint="Run `marey data text`.") from None
        try:
            spec = TextSpec.model_validate(parse_json(text_of(arrays["spec"], "spec", where), f"{where}: spec"))
        except ValidationError as error:
            message = f"not text features: {first_problem(error)}"
            raise InvalidFile(message, where=where, hint=hint) from error
        for name, kind in KINDS.items():
            width = {"strings": (spec.width,), "edges": (3,)}.get(name, ())
            check_array(arrays[name], name, where, kinds=kind, shape=(None, *width), hint=hint)
        texts = cls(spec, *(arrays[name] for name in KINDS))
        if (
            text_of(arrays["clips_sha256"], "clips_sha256", where) != data.manifest.files[CLIPS].sha256
            or len(texts.first) != len(data.clips) + 1
        ):
            raise InvalidFile("made for other captions", where=where, hint=hint)
        if problem := texts._problem():
            raise InvalidFile(f"not text features: {problem}", where=where, hint=hint)
        return texts

    def _problem(self) -> str | None:
        """Return the first inconsistency, or None."""
        captions = int(self.first[-1])
        for name, starts, size in (
            ("caption_start", self.first, captions),
            ("node_start", self.node_start, len(self.node_string)),
            ("edge_start", self.edge_start, len(self.edges)),
        ):
            if len(starts) == 0 or starts[0] != 0 or starts[-1] != size or (np.diff(starts) < 0).any():
                return f"`{name}` does not cover all rows"
        if len(self.node_start) != captions + 1 or len(self.edge_start) != captions + 1:
            return "graphs and captions differ in number"
        if len(self.node_level) != len(self.node_string) or not _within(self.node_level, len(LEVELS)):
            return "`node_level` holds an invalid level"
        if not _within(self.node_string, len(self.strings)):
            return "`node_string` names a missing string"
        nodes = np.repeat(np.diff(self.node_start), np.diff(self.edge_start))
        ends = self.edges[:, :2]
        if (ends < 0).any() or (ends >= nodes[:, None]).any() or not _within(self.edges[:, 2], len(EDGE_TYPES)):
            return "`edges` names a missing node or type"
        return None

    def slots(self, max_actions: int, max_specifics: int) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
        """Put strings and edge types in fixed slots, as the graphs that `build_graph` builds with these caps: specifics
        that only actions beyond the cap mention are left out.

        Returns:
            (K, S) index of the string in each slot, -1 = absent, and (K, S, S) edge type, -1 = none, self-loops in.
        """
        count, size = len(self.node_start) - 1, 1 + max_actions + max_specifics
        caption = np.repeat(np.arange(count), np.diff(self.node_start))  # (N,)
        level = self.node_level.astype(np.int64)
        owner = np.repeat(np.arange(count), np.diff(self.edge_start))  # (E,)
        begins, ends = (self.node_start[owner] + self.edges[:, side] for side in (0, 1))
        rank = _rank_within(caption * len(LEVELS) + level)
        wanted = (level != SPECIFIC) | np.isin(np.arange(len(level)), ends[rank[begins] < max_actions])
        rank = _rank_within((caption * len(LEVELS) + level) * 2 + wanted)  # without those of actions that are left out
        first_slot = np.array([0, 1, 1 + max_actions])[level]
        room = np.array([1, max_actions, max_specifics])[level]
        slot = np.where(wanted & (rank < room), first_slot + rank, -1)  # (N,)
        kept = slot >= 0
        strings = np.full((count, size), -1, np.int32)
        strings[caption[kept], slot[kept]] = self.node_string[kept]
        adjacency = np.full((count, size, size), -1, np.int8)
        adjacency[caption[kept], slot[kept], slot[kept]] = np.where(level[kept] == 0, MA, OTHERS)
        source, target = slot[begins], slot[ends]
        both = (source >= 0) & (target >= 0)
        owner, source, target, kind = owner[both], source[both], target[both], self.edges[both, 2]
        adjacency[owner, source, target] = kind
        adjacency[owner, target, source] = kind
        return strings, adjacency


def _within(values: NDArray[np.integer], size: int) -> bool:
    return bool(((values >= 0) & (values < size)).all())


Read = Callable[[Sequence[Sequence[str]]], Iterator[list[SemanticGraph]]]
Encode = Callable[[Sequence[Sequence[str]]], Iterator[NDArray[np.float16]]]


@contextmanager
def _readers(pipeline: TextPipeline, processes: int, encoder_path: Path | None) -> Generator[tuple[Read, Encode]]:
    """Return functions that parse and encode chunks of texts, in order."""
    if processes == 1:
        yield lambda chunks: map(pipeline.parse, chunks), lambda chunks: (_encode(pipeline, texts) for texts in chunks)
        return
    spawning = multiprocessing.get_context("spawn")  # torch's threads do not survive a fork
    with ProcessPoolExecutor(processes, spawning, _load, (pipeline.spec, encoder_path)) as pool:
        yield lambda chunks: pool.map(_parse_there, chunks), lambda chunks: pool.map(_encode_there, chunks)


def _encode(pipeline: TextPipeline, texts: Sequence[str]) -> NDArray[np.float16]:
    return np.stack(pipeline.pooled(texts)).astype(np.float16)


_loaded: list[TextPipeline] = []  # in a process of the pool: its own pipeline


def _load(spec: TextSpec, encoder_path: Path | None) -> None:
    end_with_parent()
    _loaded.append(TextPipeline.load(spec, encoder_path=encoder_path))


def _parse_there(texts: Sequence[str]) -> list[SemanticGraph]:
    return _loaded[0].parse(texts)


def _encode_there(texts: Sequence[str]) -> NDArray[np.float16]:
    return _encode(_loaded[0], texts)


def _chunks(texts: Sequence[str]) -> list[Sequence[str]]:
    return [texts[at : at + CHUNK] for at in range(0, len(texts), CHUNK)]


def _gathered(starts: NDArray[np.int64], rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where the parts of `rows` begin when they follow each other, (R + 1,), and the index of each element."""
    sizes = np.diff(starts)[rows]
    begins = _starts(sizes)
    return begins, np.arange(begins[-1]) - np.repeat(begins[:-1] - starts[rows], sizes)


def _starts(counts: Sequence[int] | NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)


def _rank_within(group: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the position of each element among those of its group, in order."""
    order = np.argsort(group, kind="stable")
    ordered = group[order]
    begins = np.r_[0, np.flatnonzero(np.diff(ordered)) + 1]
    lengths = np.diff(np.r_[begins, len(group)])
    rank = np.empty(len(group), np.int64)
    rank[order] = np.arange(len(group)) - np.repeat(begins, lengths)
    return rank
