"""Motions: find, review and fetch them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from marey.client.downloads import download_all
from marey.client.fetching import check_folder
from marey.client.file_requests import format_of, made_file
from marey.client.file_to_fetch import FORMAT, FileToFetch
from marey.client.folder_lock import alone_in
from marey.client.making import SOURCE, asked_of, check_body, check_rig, making_of
from marey.client.resources import Resource, identifier, identifiers
from marey.client.rigs import Rigs
from marey.client.types.jobs import Job
from marey.client.types.motions import Motion, MotionDetail, Reroll
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.core.extras import extra
from marey.exporters import extension_of
from marey.motion.export_options import PLAIN, ExportOptions

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip

MOST = 1000
"""Motions of one request."""
Verdict = Literal["new", "kept", "rejected", "rerolled"]
Some = Motion | str | Iterable[Motion | str]
"""A motion, its id, or several of them."""


class Motions(Resource):
    """`client.motions`. Errors of all methods: NotFound, InvalidInput, Refused, Unreachable."""

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
        """Iterate over the motions that match all filters, newest first; those of a job in the order they were made.

        Args:
            job: only motions of this job.
            tags: only motions with all of these tags, such as `shot=010`.
            name: only motions whose name begins with this.
            text: words of the prompt in any form; `"a phrase"`, `or`, `-not`.
            reviews: only motions with one of these reviews; `new` = not reviewed.
            limit: the largest number of motions; None = all.
            page_size: motions of each request, at most 1,000; None = as many as the limit allows.
        """
        wanted = None if job is None else identifier(job)
        tag, review = list_or_none(tags), list_or_none(reviews)
        params = {"job": wanted, "tag": tag, "name": name, "text": text, "review": review}
        return self._pages(Motion, "/v1/motions", limit, page_size, **params)

    def search(self, text: str, *, limit: int | None = None) -> Iterator[Motion]:
        """Iterate over the motions whose prompts contain the words of a text, newest first; see `list`."""
        return self.list(text=text, limit=limit)

    def get(self, motion: Motion | str) -> MotionDetail:
        """Return a motion with its metadata: the rewritten prompt, its graph, the settings, the software."""
        return MotionDetail.of(self._transport.get(f"/v1/motions/{identifier(motion)}"))

    def review(
        self, motions: Some, verdict: Literal["kept", "rejected"] | None, *, comment: str | None = None
    ) -> Sequence[Motion]:
        """Set the review of motions.

        Args:
            verdict: kept or rejected; None removes the review.
            comment: of the review.
        """
        return [
            Motion.of(each)
            for some in _batches(motions)
            for each in self._transport.post(
                "/v1/motions/review", {"motions": some, "verdict": verdict, "comment": comment}
            )
        ]

    def keep(self, motions: Some, *, comment: str | None = None) -> Sequence[Motion]:
        """Mark motions as kept: `client.jobs.fetch(…, review="kept")` fetches them."""
        return self.review(motions, "kept", comment=comment)

    def reject(self, motions: Some, *, comment: str | None = None) -> Sequence[Motion]:
        """Mark motions as rejected; nothing is deleted."""
        return self.review(motions, "rejected", comment=comment)

    def clear(self, motions: Some) -> Sequence[Motion]:
        """Remove the reviews of motions."""
        return self.review(motions, None)

    def reroll(self, motions: Some, *, comment: str | None = None) -> Sequence[Reroll]:
        """Generate motions again with the next seed, otherwise unchanged: a new item in the same job.

        A repeated call has no further effect; to continue, re-roll the new motion.
        """
        return [
            Reroll.of(each)
            for some in _batches(motions)
            for each in self._transport.post("/v1/motions/reroll", {"motions": some, "comment": comment})["items"]
        ]

    def revert(self, motion: Motion | str) -> Motion:
        """Go back from an edit to the motion that it was made from, and return that one; nothing is deleted.

        The edit becomes rejected. Its source becomes kept if the edit was, and is no longer rejected.

        Raises:
            Conflict: it is not an edit.
        """
        return Motion.of(self._transport.post(f"/v1/motions/{identifier(motion)}/revert"))

    def fetch(
        self, motion: Motion | str, path: str | Path, *, body: str | None = None, overwrite: bool = False
    ) -> Path:
        """Fetch a file of a motion, resumed where an earlier fetch broke off and verified by its sha256.

        Args:
            path: its ending names the format, such as `.bvh`.
            body: put the motion on a body of other proportions: a file, which needs the extra `motion`, or the name of
                a rig of the server, which then makes the file.
            overwrite: replace a file with other content.

        Raises:
            NotFound: the motion has no such file, or there is no file or rig of the body.
            Conflict: the file exists with other content.
            InvalidInput: the folder cannot be written, or the motion has another skeleton than bodies have.
            InvalidFile: the data that arrived has another sha256, or cannot be written; or the body is no human one.
            TimedOut: the server does not make the file within 10 minutes.
        """
        path = Path(path)
        export = ExportOptions(body=body)
        self._check(export)
        found = motion if isinstance(motion, Motion) else self.get(motion)
        download = _download(found, path.suffix.removeprefix(".").lower(), path, export)
        check_folder(path.parent)
        download_all(self._transport, [download], overwrite=overwrite, done=lambda _: None)
        return path

    def make_file(
        self,
        motion: Motion | str,
        path: str | Path,
        *,
        file_format: str | None = None,
        fps: float | None = None,
        timeout: float = 600.0,
        overwrite: bool = False,
        **options: str | bool,
    ) -> Path:
        """Have the server make a file of a motion, and fetch it: in a format that is not stored, at another rate, or
        with options. This machine needs neither numpy nor the extra `video`.

        Args:
            path: where to write it; its ending names the format, such as `.glb`.
            file_format: the format, where the ending does not name it.
            fps: frames a second; None = the motion's.
            timeout: seconds to wait until the file is made.
            overwrite: replace a file with other content.
            options: of the format, such as `root_bone=True` or `in_place="heading"`; the reference of the HTTP API
                lists them. `rig="hero"` puts the motion on a rig of `client.rigs`, or on `mixamo`, `ue4` or `humanik`;
                `body="hero"` gives it the proportions of one.

        Raises:
            NotFound: there is no such motion or rig, or the server does not make such files.
            InvalidInput: the server does not know an option, the motion cannot be written like this, or the folder
                cannot be written.
            TimedOut: the file is not made in time.
            Conflict: the file exists with other content.
            InvalidFile: the data that arrived has another sha256, or cannot be written.
        """
        path = Path(path)
        wanted = file_format or format_of(path)
        url = f"/v1/motions/{identifier(motion)}/files/{wanted}"
        check_folder(path.parent)
        download = made_file(self._transport, url, path, {"fps": fps, **options}, timeout=timeout)
        download_all(self._transport, [download], overwrite=overwrite, done=lambda _: None)
        return path

    def fetch_all(
        self,
        motions: Iterable[Motion],
        folder: str | Path,
        *,
        file_format: str = "npz",
        body: str | None = None,
        overwrite: bool = False,
    ) -> Sequence[Path]:
        """Fetch a file of each motion, eight at a time; the files are named by the ids of the motions.

        Args:
            folder: created if missing.
            file_format: such as npz or bvh.
            body: as of `fetch`.
            overwrite: replace files with other content.

        Raises:
            NotFound, Conflict, InvalidInput, InvalidFile, TimedOut: as `fetch`.
        """
        export = ExportOptions(body=body)
        self._check(export)
        place = check_folder(Path(folder))
        downloads = [
            _download(motion, file_format, place / f"{motion.id}.{extension_of(file_format)}", export)
            for motion in motions
        ]
        with alone_in(place):
            download_all(self._transport, downloads, overwrite=overwrite, done=lambda _: None)
        return [download.path for download in downloads]

    def _check(self, export: ExportOptions) -> None:
        check_body(export)
        check_rig(Rigs(self._transport), export)

    def load(self, motion: Motion | str) -> MotionClip:
        """Fetch a motion as a clip in memory; needs the extra `motion`.

        Raises:
            NotFound: the motion has no npz.
            InvalidInput: numpy is not installed.
        """
        with extra("motion"):
            from marey.motion.clip import load_npz
        with tempfile.TemporaryDirectory(prefix="marey-") as folder:
            try:
                return load_npz(self.fetch(motion, Path(folder) / "motion.npz"))
            except InvalidFile as error:
                error.where = f"motion {identifier(motion)}"
                raise


def _download(motion: Motion, wanted: str, path: Path, export: ExportOptions = PLAIN) -> FileToFetch:
    """Return the download of a file of a motion.

    Args:
        wanted: its format or its extension.
        export: options of the file; with them it is made of the npz.

    Raises:
        NotFound: the motion has no such file.
        Conflict: it cannot be put on the body.
    """
    by_format = {file.format: file for file in motion.files}
    named = next((name for name in by_format if wanted in (name, extension_of(name))), None)
    if named is None or not FORMAT.fullmatch(named):
        formats = ", ".join(by_format)
        hint = f"It has {formats}." if formats else "If its prompt is being erased, wait a moment."
        raise NotFound(f"has no {wanted or 'such'} file", where=f"motion {motion.id}", hint=hint)
    asked = asked_of(named, by_format, export)
    if asked is not None:
        return FileToFetch(f"/v1/motions/{identifier(motion)}/files/{named}", "", 0, path, asked=asked)
    making = making_of(named, by_format, export)
    source = by_format[named if making is None else SOURCE]
    url = f"/v1/motions/{identifier(motion)}/files/{source.format}"
    return FileToFetch(url, source.sha256, source.size, path, making)


def list_or_none(values: Sequence[str] | None) -> Sequence[str] | None:
    """Return the values of a repeated parameter; None for an empty one."""
    return [*values] if values else None


def _batches(motions: Some) -> Iterator[Sequence[str]]:
    """Yield the ids, each once, in lists of the size of one request.

    Raises:
        InvalidInput: there is no id.
    """
    ids = list(dict.fromkeys(identifiers(motions)))
    if not ids:
        raise InvalidInput("no motion is given", hint="Give at least one motion or id.")
    for first in range(0, len(ids), MOST):
        yield ids[first : first + MOST]
