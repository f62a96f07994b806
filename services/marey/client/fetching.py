"""Fetching the files of the motions of a job into a folder, with a manifest."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from marey.client.downloads import download_all
from marey.client.file_to_fetch import FORMAT, FileToFetch
from marey.client.folder_lock import alone_in
from marey.client.making import SOURCE, asked_of, check_body, check_rig, making_of
from marey.client.manifest import check_manifest, remove_left, row_of, write_manifest
from marey.client.names import DEFAULT_TEMPLATE, FileNames, Naming, slug
from marey.client.rigs import Rigs
from marey.client.transport import Transport
from marey.core.errors import Conflict, InvalidFile, InvalidInput, MareyError
from marey.exporters import check_known, check_options, exporters, extension_of
from marey.exporters.making import FileRecipe
from marey.motion.export_options import PLAIN, ExportOptions

Planned = list[tuple[dict[str, Any], list[FileToFetch]]]
"""Items of the API, in input order, each with its files."""


class FetchObserver:
    """Callbacks of a fetch; each method does nothing by default."""

    def waiting(self, folder: Path) -> None:
        """Handle another fetch that writes into the folder; this one goes on when that has ended."""

    def planned(self, total: int) -> None:
        """Handle the number of files, which is known before the first is fetched."""

    def fetched(self, path: Path) -> None:
        """Handle a file that is complete; called by the thread that fetched it."""

    def interrupted(self, done: int, total: int) -> None:
        """Handle a fetch that broke off; `done` of `total` files are complete and in the manifest."""

    def left_over(self, paths: Sequence[Path], *, removed: bool) -> None:
        """Handle files of earlier fetches of the job that this fetch does not include.

        Args:
            removed: True if they were removed.
        """


def fetch_job(
    transport: Transport,
    job: str,
    folder: Path,
    formats: Sequence[str] | None = None,
    *,
    template: str = DEFAULT_TEMPLATE,
    review: str | Sequence[str] | None = None,
    prune: bool = False,
    overwrite: bool = False,
    export: ExportOptions = PLAIN,
    observer: FetchObserver | None = None,
) -> Planned:
    """Fetch the files that a job has so far, and write the manifest.

    Args:
        formats: of files; None = all there are.
        review: fetch only motions with this verdict, or with one of several.
        prune: remove files that earlier manifests named for the job and this one does not.
        overwrite: replace files with other content.
        export: options of the files, such as a root bone: those of formats that have these options are made here of the
            npz, as are formats that the server does not have and this process has. Where they name a rig of the server
            (`ExportOptions.server_rig`), the server makes them.

    Returns:
        The items with their files.

    Raises:
        Conflict: a file exists with other content, or a format can neither be fetched nor made; nothing is fetched
            then, unless the file is one that was to be made.
        MissingExtra: an extra that writes a format which is made here is not installed; nothing is fetched then.
        InvalidInput: a format is not known here, and no motion tells whether the server has it.
        InvalidInput, InvalidFile, Unreachable: as `check_folder`, `plan` and `download_all`.
    """
    observer = observer or FetchObserver()
    _check_export(transport, formats, export)
    reviews = review if isinstance(review, str) or not review else [*review]
    pages = transport.pages(f"/v1/jobs/{job}/items", review=reviews or None, limit=1000)
    planned = plan(pages, folder, formats, template, export=export)
    if not any(item["motion"] for item, _ in planned):  # else one says which formats it has
        check_known(formats or (), hint="A format that only the server has can be fetched once there is a motion.")
    wanted = [file for _, files in planned for file in files]
    for recipe in dict.fromkeys(file.making for file in wanted if file.making is not None):
        recipe.check()
    with alone_in(check_folder(folder), lambda: observer.waiting(folder)):
        check_manifest(folder, overwrite=overwrite)
        make_folders(folder, (file.path for file in wanted))
        observer.planned(len(wanted))
        with _part_on_error(folder, job, planned, observer, overwrite=overwrite) as note:
            download_all(transport, wanted, overwrite=overwrite, done=note)
        left = write_manifest(folder, job, _rows(folder, planned), overwrite=overwrite)
        if prune:
            remove_left(folder, left)
    if left:
        observer.left_over(left, removed=prune)
    return planned


def _check_export(transport: Transport, formats: Sequence[str] | None, export: ExportOptions) -> None:
    """Check that the formats have the options, and that the body and the rig exist."""
    known = exporters()
    check_options((known[name] for name in formats or known if name in known), export)
    check_body(export)
    check_rig(Rigs(transport), export)


@contextmanager
def _part_on_error(
    folder: Path, job: str, planned: Planned, observer: FetchObserver, *, overwrite: bool
) -> Generator[Callable[[FileToFetch], None]]:
    """Within it, call what it yields with each file that is complete; an error writes a manifest of these files."""
    done: set[Path] = set()

    def note(download: FileToFetch) -> None:
        done.add(download.path)
        observer.fetched(download.path)

    try:
        yield note
    except BaseException as error:
        late = any(file.making or file.asked is not None for _, files in planned for file in files)
        if not isinstance(error, Conflict) or late:  # else nothing was fetched
            _write_part(folder, job, planned, done, observer, overwrite=overwrite)
        raise


def _write_part(
    folder: Path, job: str, planned: Planned, done: set[Path], observer: FetchObserver, *, overwrite: bool
) -> None:
    """Write the manifest of a fetch that broke off; errors are ignored, because the caller raises the first one."""
    whole = [(item, files) for item, files in planned if done.issuperset(file.path for file in files)]
    with suppress(MareyError):
        write_manifest(folder, job, _rows(folder, whole), overwrite=overwrite, whole=False)
        observer.interrupted(len(done), sum(len(files) for _, files in planned))


def _rows(folder: Path, planned: Planned) -> list[dict[str, str]]:
    return [
        row_of(item, {file.format: file.path.relative_to(folder).as_posix() for file in files})
        for item, files in planned
    ]


def check_folder(folder: Path, hint: str = "Choose another folder.") -> Path:
    """Create a folder if it is missing, check that it can be written, and return it.

    Args:
        hint: of the error.

    Raises:
        InvalidInput: it cannot be created or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InvalidInput(f"cannot write here: {error.strerror}", where=str(folder), hint=hint) from error
    return folder


def make_folders(folder: Path, paths: Iterable[Path]) -> None:
    """Create the folders of the files of a fetch.

    Raises:
        InvalidInput: one cannot be created, or a link in the folder leads out of it.
    """
    root = folder.resolve()
    for parent in sorted({path.parent for path in paths} - {folder}):
        if not parent.resolve().is_relative_to(root):
            raise InvalidInput("is a link that leads out of the folder", where=str(parent), hint="Remove the link.")
        try:
            parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidInput(f"cannot be made: {error.strerror}", where=str(parent)) from error


def plan(
    items: Iterable[dict[str, Any]],
    folder: Path,
    formats: Sequence[str] | None,
    template: str = DEFAULT_TEMPLATE,
    *,
    export: ExportOptions = PLAIN,
) -> Planned:
    """Plan the files of each item and their paths.

    Args:
        items: items of the API, in input order.
        formats: of files; None = all there are.
        export: options of the files.

    Raises:
        InvalidInput: two motions would have one name, or a name is not a plain file name.
        InvalidFile: the server names a format that is not a plain word.
        Conflict: a wanted format was not made, and cannot be made here.
    """
    planned: Planned = []
    names = FileNames(template)
    for item in items:
        downloads: list[FileToFetch] = []
        motion = item["motion"]
        for file, making, asked in _wanted(motion["files"], formats, export, item["id"]) if motion else ():
            if not FORMAT.fullmatch(file["format"]):  # it becomes part of the path, which must stay in the folder
                raise InvalidFile(f"the server names the file format {file['format']!r}", where=f"item {item['id']}")
            wanted = file["format"] if making is None else making.format
            name = names.of(item["id"], naming(item), extension_of(wanted))
            url = f"/v1/motions/{motion['id']}/files/{file['format']}"
            downloads.append(FileToFetch(url, file["sha256"], file["size"], folder / name, making, asked))
        planned.append((item, downloads))
    return planned


def naming(item: dict[str, Any]) -> Naming:
    """Return the values of a name template for an item of the API."""
    return Naming(
        index=item["index"],
        name=item["name"] or slug(item["prompt"]),
        seed=item["seed"],
        variant=item["variant"],
        model=item["model"],
        job=item["job"],
        tags=item["tags"],
        bundle=item["bundle"],
        prompt=slug(item["prompt"]),
    )


def _wanted(
    files: list[dict[str, Any]], formats: Sequence[str] | None, export: ExportOptions, item: str
) -> Iterator[tuple[dict[str, Any], FileRecipe | None, Mapping[str, str | bool] | None]]:
    """Yield the file to fetch for each format, with how the wanted one is made of it, and the options of one that the
    server makes."""
    by_format = {file["format"]: file for file in files}
    for name in by_format if formats is None else formats:
        asked = asked_of(name, by_format, export)
        if asked is not None:
            yield {"format": name, "sha256": "", "size": 0}, None, asked
            continue
        making = making_of(name, by_format, export)
        if making is None and name not in by_format:
            raise Conflict(f"was not made as {name}", where=f"item {item}", hint=f"It has {', '.join(by_format)}.")
        yield by_format[name if making is None else SOURCE], making, None
