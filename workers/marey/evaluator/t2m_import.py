"""Import the public T2M evaluator, once, offline: checkpoint, statistics and word vectors become a bundle.

    python -m marey.evaluator.t2m_import CHECKPOINTS --glove GLOVE -o BUNDLE

CHECKPOINTS is the public folder `checkpoints/t2m`, with `text_mot_match/model/finest.tar` and
`Comp_v6_KLD005/meta/mean.npy` and `std.npy`; GLOVE the public folder `glove` with `our_vab_data.npy`,
`our_vab_words.pkl` and `our_vab_idx.pkl`.

The checkpoint is read with `weights_only=True`, which refuses anything but tensors and plain values. The two pickles of
words are read by an unpickler without classes, which creates strings, numbers, lists and dictionaries alone.
Evaluations later load the bundle: safetensors and JSON, with hashes.

It has never run on the public files: see `marey.evaluator.t2m`.
"""

from __future__ import annotations

import argparse
import pickle
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from marey.bundles import Bundle, BundleWriter, DataSource
from marey.core.arrays import read_npy
from marey.core.characters import escape
from marey.core.errors import InvalidFile, MareyError
from marey.evaluator.t2m import MODEL, WORDS_FILE, WORDS_PART
from marey.evaluator.t2m_model import T2MConfig, T2MMotionEncoder, T2MTextEncoder
from marey.evaluator.t2m_words import END, START, UNKNOWN
from marey.motion.features import layout
from marey.nn.bundling import stored

LICENCE = "LicenseRef-AMASS-NC"
"""The code is MIT; the weights have no stated terms, and derive from HumanML3D, which is made of AMASS."""


def import_t2m(checkpoints: Path, glove: Path, output: Path, config: T2MConfig | None = None) -> Bundle:
    """Convert the public files to a bundle.

    Args:
        checkpoints: see the top of this module.
        glove: see the top of this module.
        output: the bundle's folder.
        config: other sizes, or another layout (KIT-ML's); None = the public ones.

    Raises:
        InvalidFile: a file is missing, damaged, or of another kind.
        Conflict: the bundle already exists.
    """
    config = config or T2MConfig()
    motion, text = T2MMotionEncoder(config), T2MTextEncoder(config)
    file = checkpoints / "text_mot_match" / "model" / "finest.tar"
    weights = _checkpoint(file)
    for name, network in (
        ("movement_encoder", motion.movement),
        ("motion_encoder", motion.motion),
        ("text_encoder", text),
    ):
        _fill(network, weights, name, file)
    mean, std = (_statistic(checkpoints / "Comp_v6_KLD005" / "meta" / f"{n}.npy", config) for n in ("mean", "std"))
    words, vectors = _read_words(glove, config)
    with BundleWriter(output) as writer:
        for name, network in (("motion", motion), ("text", text)):
            state = {k: v.numpy() for k, v in network.state_dict().items() if stored(k)}
            writer.add_part(name, state, dtype=np.float32)  # as published: numbers are compared with published ones
        writer.add_statistics(mean, std)
        writer.add_part(WORDS_PART, {"vectors": vectors}, dtype=np.float32)
        writer.add_json(WORDS_FILE, words)
        writer.add_card(CARD)
        return writer.finish(
            name=output.name,
            version="1",
            kind="evaluator",
            model=MODEL,
            config=config.name,
            parameters=config.to_dict(),
            skeleton=layout(config.layout).skeleton.name,
            layout=config.layout,
            fps=config.fps,
            data=(
                DataSource(name="HumanML3D", licence=LICENCE, credit="Guo et al. 2022; GloVe, Pennington et al. 2014"),
            ),
            licence=LICENCE,
        )


def _checkpoint(file: Path) -> Mapping[str, Any]:
    try:
        loaded: Any = torch.load(file, map_location="cpu", weights_only=True)
    except (OSError, pickle.UnpicklingError, RuntimeError, EOFError, ValueError) as error:
        raise InvalidFile(f"cannot be read safely: {error}", where=str(file), hint="Download it again.") from error
    if not isinstance(loaded, Mapping):
        raise InvalidFile("is not a checkpoint", where=str(file))
    return loaded


def _fill(network: nn.Module, weights: Mapping[str, Any], name: str, file: Path) -> None:
    try:
        network.load_state_dict(weights[name])
    except (KeyError, TypeError, RuntimeError) as error:
        raise InvalidFile(f"its {name} does not fit the public evaluator: {error}", where=str(file)) from error


def _statistic(file: Path, config: T2MConfig) -> NDArray[np.float32]:
    values = _array(file)
    if values.shape != (config.features,) or not np.isfinite(values).all():
        raise InvalidFile(f"has shape {values.shape}, not ({config.features},) finite numbers", where=str(file))
    return values.astype(np.float32)


def _read_words(folder: Path, config: T2MConfig) -> tuple[list[str], NDArray[np.float32]]:
    """Return the vocabulary and its vectors, row by row."""
    data = folder / "our_vab_data.npy"
    vectors, words, index = _array(data), _plain(folder / "our_vab_words.pkl"), _plain(folder / "our_vab_idx.pkl")
    if not isinstance(words, list) or not isinstance(index, dict) or not {START, END, UNKNOWN} <= set(words):
        raise InvalidFile("is not a vocabulary of the T2M evaluator", where=str(folder))
    rows = [index.get(word, -1) for word in words]
    if vectors.ndim != 2 or vectors.shape[1] != config.word_width or not all(0 <= r < len(vectors) for r in rows):
        raise InvalidFile(f"vectors of shape {vectors.shape} do not fit the words", where=str(data))
    return words, vectors[rows].astype(np.float32)


def _array(file: Path) -> NDArray[Any]:
    return read_npy(file)


class _PlainValues(pickle.Unpickler):
    """Unpickler that knows no class: strings, numbers, lists and dictionaries load, everything else is refused."""

    def find_class(self, module_name: str, global_name: str, /) -> Any:
        """Refuse every class."""
        raise pickle.UnpicklingError(f"refused: {module_name}.{global_name}")


def _plain(file: Path) -> Any:
    try:
        with file.open("rb") as stream:
            return _read_plain(stream)
    except (OSError, pickle.UnpicklingError, EOFError, ValueError, TypeError, KeyError, IndexError) as error:
        raise InvalidFile(f"is not a plain list or dictionary: {error}", where=str(file)) from error


def _read_plain(stream: IO[bytes]) -> Any:
    return _PlainValues(stream).load()


CARD = """# The public T2M evaluator, imported

Guo et al. 2022, "Generating Diverse and Natural 3D Human Motions from Text": `text_mot_match` with GloVe `our_vab` and
the statistics `Comp_v6_KLD005`, converted by `python -m marey.evaluator.t2m_import`. Trained on HumanML3D. Before
its numbers are believed, its ground-truth row should be compared with the published one: R@1 .511, matching score
2.974.
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line of this module; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m marey.evaluator.t2m_import", description="See the module.")
    parser.add_argument("checkpoints", type=Path)
    parser.add_argument("--glove", type=Path, required=True)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args(arguments)
    try:
        made = import_t2m(options.checkpoints, options.glove, options.output).path
    except MareyError as error:
        sys.stderr.write(f"{escape(str(error))}\n")
        return error.exit_code
    sys.stdout.write(f"{made}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
