"""Public names of a package that are imported when they are first used, so that its submodules stay cheap to import."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module

from marey.core.package import own_version


def lazy_names(package: str, places: Mapping[str, str]) -> Callable[[str], object]:
    """Return the `__getattr__` of a package.

    Args:
        package: its `__name__`.
        places: for each module the names that it holds, separated by blanks. `__version__` is always there.
    """
    modules = {name: module for module, names in places.items() for name in names.split()}

    def get(name: str) -> object:
        if name == "__version__":
            return own_version()
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(modules[name]), name)

    return get
