"""Motion generation in this process, without a server. Needs the extra `worker`.

    from marey.generate import load

    model = load("hgm3-starter")
    (clip,) = model.generate(["a person waves"], seed=1)
    clip.save_npz("wave.npz")

Names in `__all__` are public and documented in `docs/reference/python-api.md`; the modules of this package are not.
Names are imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.core.lazy import lazy_names

if TYPE_CHECKING:
    from marey.generate.local import LocalModel, load

    __version__: str

__getattr__ = lazy_names(__name__, {"marey.generate.local": "LocalModel load"})

__all__ = ["LocalModel", "__version__", "load"]
