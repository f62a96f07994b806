"""The installed export formats."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

from marey.core.errors import PluginError
from marey.exporters.exporter import Exporter

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "marey.exporters"
CANONICAL = "npz"
"""The format that evaluations, reviews and previews read."""


@cache
def exporters() -> Mapping[str, Exporter[Any]]:
    """Return the installed exporters by format, in alphabetical order.

    Entry points are read once a process: restart it after a plug-in was installed.

    Raises:
        PluginError: a plug-in cannot be loaded, two have the same name or extension, or Marey's own formats are not
            registered.
    """
    from importlib.metadata import entry_points  # 0.1 s, which most commands do not need

    found: dict[str, Exporter[Any]] = {}
    entries: dict[str, EntryPoint] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        exporter = _load(entry)
        for other in found.values():
            if other.format == exporter.format or other.extension == exporter.extension:
                raise PluginError(
                    f"two exporters have the format {exporter.format!r} or files .{exporter.extension}",
                    where=f"entry points {GROUP}",
                    hint=f"Uninstall one of {_name(entries[other.format])} and {_name(entry)}.",
                )
        found[exporter.format], entries[exporter.format] = exporter, entry
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


def extension_of(format: str) -> str:
    """Return the ending of a format's file names: the format itself where its exporter is not installed."""
    found = exporters().get(format)
    return format if found is None else found.extension


def _load(entry: EntryPoint) -> Exporter[Any]:
    try:
        exporter = entry.load()
    except Exception as error:
        raise PluginError(
            f"cannot be loaded: {type(error).__name__}: {error}",
            where=_name(entry),
            hint="Update the plug-in, or uninstall it.",
        ) from error
    if not isinstance(exporter, Exporter) or exporter.format != entry.name:
        raise PluginError(
            f"is not an Exporter of the format {entry.name!r}",
            where=_name(entry),
            hint="The name of the entry point is the exporter's format.",
        )
    return cast("Exporter[Any]", exporter)


def _name(entry: EntryPoint) -> str:
    return f"{entry.name} = {entry.value}" + (f" ({entry.dist.name})" if entry.dist is not None else "")
