"""Import the public T2M evaluator: checkpoint, statistics and word vectors become a bundle.

    marey models import t2m-evaluator FOLDER -o BUNDLE

FOLDER is the published folder `checkpoints/t2m`, or one that holds it, with `text_mot_match/model/finest.tar` and
`Comp_v6_KLD005/meta/mean.npy` and `std.npy`. The folder `glove`, with `our_vab_data.npy`, `our_vab_words.pkl` and
`our_vab_idx.pkl`, lies in it or beside `checkpoints`, as published.

The two pickles of words are read by an unpickler without classes, which creates strings, numbers, lists and
dictionaries alone.

It has never run on the public files: see `marey.evaluator.t2m`.
"""

from __future__ import annotations

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.bundles import Bundle, BundleWriter, DataSource
from marey.core.arrays import map_npy
from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile
from marey.evaluator.t2m import MODEL, WORDS_FILE, WORDS_PART
from marey.evaluator.t2m_model import T2MConfig, T2MMotionEncoder, T2MTextEncoder
from marey.evaluator.t2m_words import END, START, UNKNOWN
from marey.importing import Download, ImportRequest, make_card, provenance
from marey.motion.features import layout
from marey.nn.bundling import stored

KIT = T2MConfig(name="public-kit", layout="kit-251", features=251, fps=12.5)
INSIDE = ("checkpoints/t2m", "checkpoints/kit", "checkpoint_dir/humanml3d")
"""Where the files lie in the downloads of T2M and MoMask, and in that of MoMask++."""
GLOVE = ("glove", "../glove", "../../glove")
GLOVE_FILES = ("our_vab_data.npy", "our_vab_words.pkl", "our_vab_idx.pkl")
MAX_PICKLE_BYTES = 2**26
CREDIT = "Guo et al. 2022; GloVe, Pennington et al. 2014"


def import_t2m(request: ImportRequest, config: T2MConfig | None = None) -> Bundle:
    """Import the evaluator of a download.

    Args:
        request: the import.
        config: other sizes; None = the public ones.

    Raises:
        NotFound: a file is missing.
        InvalidFile: a file is damaged, of another kind, or of other sizes.
        Conflict: the bundle already exists.
    """
    download = Download(request.folder, inside=INSIDE)
    meta = download.find("Comp_v6_KLD005/meta", what="the folder of the evaluator's statistics")
    config = config or published_config(meta / "mean.npy")
    motion, text = _read_encoders(download, config)
    mean, std = download.statistics(meta, config.features)
    words, vectors = _read_words(download, config)
    accounts = download.finish()
    data_set = "KIT-ML" if config.layout == KIT.layout else "HumanML3D"
    with BundleWriter(request.output, overwrite=request.overwrite) as writer:
        for name, network in (("motion", motion), ("text", text)):
            state = {k: v.numpy() for k, v in network.state_dict().items() if stored(k)}
            writer.add_part(name, state, dtype=np.float32)  # as published: numbers are compared with published ones
        writer.add_statistics(mean, std)
        writer.add_part(WORDS_PART, {"vectors": vectors}, dtype=np.float32)
        writer.add_json(WORDS_FILE, words)
        writer.add_card(make_card(request, accounts, about=ABOUT, normalisation=NORMALISATION))
        return writer.finish(
            name=request.output.name,
            version="1",
            kind="evaluator",
            model=MODEL,
            config=config.name,
            parameters=config.to_dict(),
            skeleton=layout(config.layout).skeleton.name,
            layout=config.layout,
            fps=config.fps,
            data=(DataSource(name=data_set, licence=request.licence, credit=CREDIT),),
            licence=request.licence,
            training=provenance(request, accounts),
        )


def _read_encoders(download: Download, config: T2MConfig) -> tuple[T2MMotionEncoder, T2MTextEncoder]:
    """Return the encoders of motion and text with the weights of the download."""
    motion, text = T2MMotionEncoder(config), T2MTextEncoder(config)
    checkpoint = download.checkpoint(download.find("text_mot_match/model/finest.tar", what="the evaluator"))
    checkpoint.section("movement_encoder").fill(motion.movement)
    checkpoint.section("motion_encoder").fill(motion.motion)
    checkpoint.section("text_encoder").fill(text)
    return motion, text


def published_config(mean: Path) -> T2MConfig:
    """Return the public sizes for the data set whose statistics these are: HumanML3D or KIT-ML.

    Raises:
        NotFound, InvalidFile: the file is missing, or is of neither.
    """
    found = map_npy(mean).shape
    for config in (T2MConfig(), KIT):
        if found == (config.features,):
            return config
    raise InvalidFile(f"has shape {found}; HumanML3D's has 263 numbers, KIT-ML's 251", where=str(mean))


def _read_words(download: Download, config: T2MConfig) -> tuple[list[str], NDArray[np.float32]]:
    """Return the vocabulary and its vectors, row by row."""
    folder = download.find(*GLOVE, what="the folder of word vectors")
    data, listed, indexed = (folder / name for name in GLOVE_FILES)
    vectors = download.array(data, (None, config.word_width))
    words, index = _plain(listed), _plain(indexed)
    if not isinstance(words, list) or not isinstance(index, dict) or not {START, END, UNKNOWN} <= set(words):
        raise InvalidFile("is not a vocabulary of the T2M evaluator", where=str(folder))
    rows = [index.get(word, -1) for word in words]
    if not all(isinstance(row, int) and 0 <= row < len(vectors) for row in rows):
        raise InvalidFile(f"has {len(vectors)} vectors, which do not fit the words", where=str(data))
    download.note(listed)
    download.note(indexed)
    return words, vectors[rows].astype(np.float32)


class _PlainValues(pickle.Unpickler):
    """Unpickler that knows no class: strings, numbers, lists and dictionaries load, everything else is refused."""

    def find_class(self, module_name: str, global_name: str, /) -> Any:
        """Refuse every class."""
        raise pickle.UnpicklingError(f"refused: {module_name}.{global_name}")


def _plain(file: Path) -> Any:
    data = read_bytes(file, limit=MAX_PICKLE_BYTES, hint="It is a part of the published folder `glove`.")
    try:
        return _PlainValues(io.BytesIO(data)).load()
    except Exception as error:  # a crafted or truncated pickle raises nearly any exception
        raise InvalidFile(f"is not a plain list or dictionary: {error}", where=str(file)) from None


ABOUT = """The public T2M evaluator: Guo et al. 2022, "Generating Diverse and Natural 3D Human Motions from Text",
`text_mot_match` with GloVe `our_vab`. Trained on HumanML3D, or on KIT-ML where it reads 251 features. The code is MIT;
the weights have no stated terms; HumanML3D is made of AMASS.

Before its numbers are believed, its row of real data should be compared with the published one: R@1 .511, matching
score 2.974."""
NORMALISATION = """Mean and deviation of `Comp_v6_KLD005/meta`, the evaluator's own; a generator's are never used for
it."""
