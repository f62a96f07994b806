"""Plug-ins: what installed distributions register in one entry-point group, found, loaded and refused in one way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Generic, TypeVar

from marey.core.errors import PluginError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")


class PlugIns(Generic[T]):
    """The plug-ins of one entry-point group. Entry points are read once a process: restart it after an installation.

    Args:
        group: of the entry points.
        kind: of the objects that they name.
        name_of: the name of such an object, which its entry point has too; None = the object does not know its name.
    """

    def __init__(self, group: str, kind: type[T], name_of: Callable[[T], str] | None = None) -> None:
        self.group = group
        self._kind = kind
        self._name_of = name_of
        self._entries: Mapping[str, EntryPoint] | None = None
        self._loaded: dict[str, T] = {}

    def names(self) -> tuple[str, ...]:
        """All registered names, sorted; imports nothing of them.

        Raises:
            PluginError: two packages register one name.
        """
        return tuple(self._found())

    def find(self, name: str) -> T | None:
        """The plug-in of this name; None where it is not installed here.

        Raises:
            PluginError: two packages register one name, or this one cannot be loaded or is something else.
        """
        if name not in self._loaded:
            entry = self._found().get(name)
            if entry is None:
                return None
            self._loaded[name] = self._load(entry)
        return self._loaded[name]

    def all(self) -> dict[str, T]:
        """Every plug-in by name, sorted.

        Raises:
            PluginError: as `find`.
        """
        return {name: found for name in self.names() if (found := self.find(name)) is not None}

    def owner(self, name: str) -> str:
        """The package that registers a name, or the entry point's value where its package is not known."""
        entry = self._found()[name]
        return entry.value if entry.dist is None else entry.dist.name

    def version(self, name: str) -> str:
        """The version of the package that registers a name; empty where its package is not known."""
        entry = self._found()[name]
        return "" if entry.dist is None else entry.dist.version

    def clear(self) -> None:
        """Read the entry points again at the next look-up, for tests that install plug-ins."""
        self._entries = None
        self._loaded.clear()

    def _found(self) -> Mapping[str, EntryPoint]:
        if self._entries is None:
            from importlib.metadata import entry_points  # 15 to 100 ms, which most commands need not spend

            found: dict[str, EntryPoint] = {}
            for entry in sorted(entry_points(group=self.group), key=lambda each: each.name):
                other = found.setdefault(entry.name, entry)
                if other.value != entry.value:
                    raise PluginError(
                        f"two packages register {entry.name!r}: {_shown(other)} and {_shown(entry)}",
                        where=f"entry points {self.group}",
                        hint="Uninstall one of them.",
                    )
            self._entries = found
        return self._entries

    def _load(self, entry: EntryPoint) -> T:
        try:
            found = entry.load()
        except Exception as error:
            raise PluginError(
                f"cannot be loaded: {type(error).__name__}: {error}",
                where=f"{self.group}: {_shown(entry)}",
                hint="Update the plug-in, or uninstall it.",
            ) from error
        if isinstance(found, self._kind) and (self._name_of is None or self._name_of(found) == entry.name):
            return found
        raise PluginError(
            f"is not the {self._kind.__name__} of the name {entry.name!r}",
            where=f"{self.group}: {_shown(entry)}",
            hint="The entry point has the name of what it registers: see docs/extending.md.",
        )


def _shown(entry: EntryPoint) -> str:
    return f"{entry.name} = {entry.value}" + (f" ({entry.dist.name})" if entry.dist is not None else "")
