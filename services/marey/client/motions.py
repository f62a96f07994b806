"""Motions: find them, look at them, and say which are good."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from marey.client.fetching import FORMAT, Download, check_folder, download_all
from marey.client.resources import Resource, identifier, identifiers
from marey.client.types import Job, Motion, MotionDetail, Reroll
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.core.extras import needs_extra
from marey.exporters import extension_of

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip

MOST = 1000
"""Motions of one request."""
Verdict = Literal["new", "kept", "rejected", "rerolled"]
Some = Motion | str | Iterable[Motion | str]
"""A motion, its id, or several of them."""


class Motions(Resource):
    """`client.motions`."""

    def list(
        self,
        *,
        job: Job | str | None = None,
        tags: Sequence[str] | None = None,
        name: str | None = None,
        text: str | None = None,
        reviews: Sequence[Verdict] | None = None,
        limit: int | None = None,
        page_size: int | None = None,
    ) -> Iterator[Motion]:
        """The motions that fit everything given, newest first; of a job, in the order they were made.

        Args:
            tags: as they were given, such as `shot=010`; all of them.
            name: how the name begins.
            text: words of the prompt in any form; `"a phrase"`, `or`, `-not`.
            reviews: verdicts; any of them. `new` = none yet.
            limit: at most so many; None = all.
            page_size: of each request, at most 1,000; None = as large as the limit allows.
        """
        wanted = None if job is None else identifier(job)
        tag, review = list_or_none(tags), list_or_none(reviews)
        params = {"job": wanted, "tag": tag, "name": name, "text": text, "review": review}
        return self._pages(Motion, "/v1/motions", limit, page_size, **params)

    def search(self, text: str, *, limit: int | None = None) -> Iterator[Motion]:
        """The motions whose prompts hold the words of a text, newest first; see `list`."""
        return self.list(text=text, limit=limit)

    def get(self, motion: Motion | str) -> MotionDetail:
        """A motion with its metadata: the rewritten prompt, its graph, the settings, the software."""
        return MotionDetail.of(self._transport.get(f"/v1/motions/{identifier(motion)}"))

    def review(
        self, motions: Some, verdict: Literal["kept", "rejected"] | None, *, comment: str | None = None
    ) -> Sequence[Motion]:
        """Set the verdict of motions; None takes it back."""
        return [
            Motion.of(each)
            for some in _batches(motions)
            for each in self._transport.post(
                "/v1/motions/review", {"motions": some, "verdict": verdict, "comment": comment}
            )
        ]

    def keep(self, motions: Some, *, comment: str | None = None) -> Sequence[Motion]:
        """Say that motions are good: `client.jobs.fetch(…, review="kept")` fetches them."""
        return self.review(motions, "kept", comment=comment)

    def reject(self, motions: Some, *, comment: str | None = None) -> Sequence[Motion]:
        """Say that motions are no good; nothing is deleted."""
        return self.review(motions, "rejected", comment=comment)

    def clear(self, motions: Some) -> Sequence[Motion]:
        """Take back what was said of motions."""
        return self.review(motions, None)

    def reroll(self, motions: Some, *, comment: str | None = None) -> Sequence[Reroll]:
        """Make motions again with the next seed, everything else as it was: a new item in the same job.

        Asked twice, it is done once; to go on, re-roll the new motion.
        """
        return [
            Reroll.of(each)
            for some in _batches(motions)
            for each in self._transport.post("/v1/motions/reroll", {"motions": some, "comment": comment})["items"]
        ]

    def fetch(self, motion: Motion | str, path: str | Path, *, overwrite: bool = False) -> Path:
        """Fetch a file of a motion, resumed and checked by its sha256; the ending of the path says which, as `.bvh`.

        Raises:
            NotFound: the motion has no such file.
            Conflict: a file is there and holds something else.
            InvalidFile: what arrived has another sha256, or cannot be written.
        """
        path = Path(path)
        found = motion if isinstance(motion, Motion) else self.get(motion)
        file_format = path.suffix.removeprefix(".").lower()
        file = next((file for file in found.files if file_format in (file.format, extension_of(file.format))), None)
        if file is None or not FORMAT.fullmatch(file.format):
            formats = ", ".join(file.format for file in found.files)
            raise NotFound(
                f"has no {file_format or 'such'} file", where=f"motion {found.id}", hint=f"It has {formats}."
            )
        check_folder(path.parent)
        url = f"/v1/motions/{identifier(found)}/files/{file.format}"
        download = Download(url, file.sha256, file.size, path)
        download_all(self._transport, [download], overwrite=overwrite, done=lambda _: None)
        return path

    def load(self, motion: Motion | str) -> MotionClip:
        """Fetch a motion as a clip in memory. Needs the extra `motion`.

        Raises:
            NotFound: the motion has no npz.
            InvalidInput: numpy is not installed.
        """
        try:
            from marey.motion.clip import load_npz
        except ImportError as error:
            raise needs_extra("motion", error) from error
        with tempfile.TemporaryDirectory(prefix="marey-") as folder:
            try:
                return load_npz(self.fetch(motion, Path(folder) / "motion.npz"))
            except InvalidFile as error:
                error.where = f"motion {identifier(motion)}"
                raise


def list_or_none(values: Sequence[str] | None) -> Sequence[str] | None:
    """The values of a repeated parameter; None where there is none."""
    return [*values] if values else None


def _batches(motions: Some) -> Iterator[Sequence[str]]:
    """The ids, each once, as many as one request takes at a time.

    Raises:
        InvalidInput: there is none.
    """
    ids = list(dict.fromkeys(identifiers(motions)))
    if not ids:
        raise InvalidInput("there is no motion", hint="Give at least one motion or id.")
    for first in range(0, len(ids), MOST):
        yield ids[first : first + MOST]
