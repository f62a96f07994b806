"""The installed export formats."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from marey.core.errors import InvalidInput, PluginError
from marey.core.package import own_version
from marey.core.suggestions import did_you_mean
from marey.exporters.exporter import Exporter
from marey.motion.export_options import ExportOptions
from marey.registry import PlugIns

GROUP = "marey.exporters"
CANONICAL = "npz"
"""The format that evaluations, reviews and previews read."""
EXPORTERS: PlugIns[Exporter[Any]] = PlugIns(GROUP, Exporter, lambda exporter: exporter.format)


@cache
def exporters() -> Mapping[str, Exporter[Any]]:
    """Return the installed exporters by format, in alphabetical order.

    Raises:
        PluginError: a plug-in cannot be loaded, two have the same name or extension, or Marey's own formats are not
            registered.
    """
    found = EXPORTERS.all()
    by_extension: dict[str, str] = {}
    for exporter in found.values():
        other = by_extension.setdefault(exporter.extension, exporter.format)
        if other != exporter.format:
            raise PluginError(
                f"two exporters write files .{exporter.extension}: {other!r} and {exporter.format!r}",
                where=f"entry points {GROUP}",
                hint=f"Uninstall one of {EXPORTERS.owner(other)} and {EXPORTERS.owner(exporter.format)}.",
            )
    if CANONICAL not in found:
        raise PluginError(
            f"no exporter of {CANONICAL!r} is registered",
            where=f"entry points {GROUP}",
            hint="Marey's metadata is older than its code, or missing: install it again.",
        )
    return MappingProxyType(found)


def exporter_of(format: str) -> Exporter[Any]:
    """Return the exporter of a format.

    Raises:
        PluginError: it is not installed here.
    """
    found = exporters().get(format)
    if found is None:
        raise PluginError(
            f"no exporter of the format {format!r} is installed",
            where=f"entry points {GROUP}",
            hint=f"Install the plug-in that wrote such files. Installed: {', '.join(exporters())}.",
        )
    return found


@cache
def version_of(format: str) -> str:
    """Return the versions of the package that has the exporter, and of Marey: files of others may differ.

    Raises:
        PluginError: the format is not installed here.
    """
    exporter_of(format)
    return f"{EXPORTERS.owner(format)} {EXPORTERS.version(format)}, marey {own_version()}"


def check_known(formats: Iterable[str], *, hint: str = "") -> None:
    """Validate that each format is installed here.

    Args:
        hint: follows the known formats.

    Raises:
        InvalidInput: one is not.
    """
    known = exporters()
    for name in formats:
        if name not in known:
            raise InvalidInput(
                f"{name[:40]!r} is not a known motion format{did_you_mean(name, known)}",
                where="formats",
                hint=" ".join(filter(None, (f"Known: {', '.join(known)}.", hint))),
                argument="formats",
            )


def extension_of(format: str) -> str:
    """Return the ending of a format's file names: the format itself where its exporter is not installed."""
    found = exporters().get(format)
    return format if found is None else found.extension


def exporter_named(file_name: str) -> Exporter[Any] | None:
    """Return the exporter whose extension a file name has, or None; of two, the longer: `a.smplx.npz` is no npz of a
    motion."""
    name = file_name.lower()
    having = (each for each in exporters().values() if name.endswith(f".{each.extension}"))
    return max(having, key=lambda each: len(each.extension), default=None)


def exporter_for(path: Path) -> Exporter[Any]:
    """Return the exporter whose extension the name of a file has.

    Raises:
        InvalidInput: there is none.
    """
    found = exporter_named(path.name)
    if found is None:
        known = ", ".join(f".{each.extension}" for each in exporters().values())
        raise InvalidInput(f"`{path.suffix}` is not a known motion format", where=str(path), hint=f"Known: {known}.")
    return found


def check_options(writers: Iterable[Exporter[Any]], options: ExportOptions) -> None:
    """Validate that each chosen option acts on the files of a format.

    Raises:
        InvalidInput: none of the formats has it.
    """
    writers = list(writers)
    for name in options.chosen:
        if name == "rig_map" and options.body is not None:  # it is that of the body, which every format has
            continue
        if not any(name in each.heeded for each in writers):
            having = [each.format for each in exporters().values() if name in each.heeded]
            raise InvalidInput(
                f"{', '.join(each.format for each in writers)} files have no such option",
                where=name,
                hint=f"Formats that have {name}: {', '.join(having)}.",
                argument=name,
            )


def check_writers(writers: Iterable[Exporter[Any]], options: ExportOptions) -> None:
    """Validate, before motions are made, that this process can write them in these formats with these options.

    Raises:
        MissingExtra: an extra that writes a format is not installed.
        InvalidInput: as `check_options`, or a format needs an option that is not given.
        NotFound, InvalidFile, TooLarge: the file of a rig that a format needs cannot be read.
    """
    writers = list(writers)
    check_options(writers, options)
    for writer in writers:
        if writer.check is not None:
            writer.check(options)
