"""Import SnapMoGen's published evaluator: checkpoint and statistics of the data set become a bundle.

    marey models import snapmogen-evaluator FOLDER -o BUNDLE --text-encoder T5

FOLDER is the published `checkpoint_dir`, or one that holds it. The statistics are the data set's: `meta_data/mean.npy`
and `std.npy`, whose folder is put into FOLDER or beside it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marey.bundles import Bundle, DataSource
from marey.core.errors import InvalidFile
from marey.evaluator.bundle import write_bundle
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.published_names import published_name
from marey.evaluator.snapmogen_model import MODEL, PUBLIC, SnapMoGenMotionEncoder, SnapMoGenSentenceEncoder
from marey.importing import Checkpoint, Download, Fields, ImportRequest, make_card, provenance, text_encoder_of

INSIDE = ("checkpoint_dir/snapmogen/evaluator",)
WEIGHTS = ("model/net_best_top1.tar", "model/latest.tar")
META = ("meta_data", "../meta_data", "../../meta_data", "../../../meta_data", "../../../../meta_data")
ENCODER = "t5-v1_1-base"
CREDIT = "Guo et al. 2025, SnapMoGen: Human Motion Generation from Expressive Texts"


def import_snapmogen(request: ImportRequest, config: EvaluatorConfig = PUBLIC) -> Bundle:
    """Import the evaluator of a download.

    Args:
        request: the import.
        config: other sizes, for tests; the public ones by default.

    Raises:
        NotFound: a file, or the text encoder, is missing.
        InvalidFile: a file is damaged, of another kind, or of other sizes.
        Conflict: the bundle already exists.
    """
    download = Download(request.folder, inside=INSIDE)
    yaml = download.find("eval_*/evaluator.yaml", "evaluator.yaml", what="the configuration of the evaluator")
    config = _with_heads(config, download.yaml(yaml))
    file = download.find(*WEIGHTS, what="the evaluator", within=yaml.parent)
    motion, text = SnapMoGenMotionEncoder(config), SnapMoGenSentenceEncoder(config)
    _fill(download.checkpoint(file), motion, text)
    statistics = download.statistics(download.find(*META, what="the data set's statistics"), config.features)
    accounts = download.finish()
    with text_encoder_of(request, ENCODER) as spec:
        return write_bundle(
            request.output,
            config,
            {"motion": motion.state_dict(), "text": text.state_dict()},
            statistics,
            None,
            text=spec,
            card=make_card(request, accounts, about=ABOUT, normalisation=NORMALISATION, text=spec),
            model=MODEL,
            dtype=np.float32,
            overwrite=request.overwrite,
            licence=request.licence,
            data=(DataSource(name="SnapMoGen", licence=request.licence, credit=CREDIT),),
            training=provenance(request, accounts),
        )


def _fill(checkpoint: Checkpoint, motion: SnapMoGenMotionEncoder, text: SnapMoGenSentenceEncoder) -> None:
    """Fill the encoders: the best checkpoint holds one table for each, the latest one table for all networks."""
    whole = "eval_model" in checkpoint.keys
    for key, network, made in (("latent_enc", motion, {}), ("text_enc", text, text.unchanged)):
        prefix = f"{key}." if whole else ""
        section = checkpoint.section("eval_model" if whole else key)
        section.fill(network, lambda name, prefix=prefix: prefix + published_name(name), made=made)
        section.ignore(r"latent_dec\..*", "the decoder, which is used in training alone")
    checkpoint.ignore("latent_dec", "the decoder, which is used in training alone")


def _with_heads(config: EvaluatorConfig, fields: Fields) -> EvaluatorConfig:
    """Return the configuration with the number of attention heads of the file, which no tensor's shape tells.

    Raises:
        InvalidFile: several numbers, or one that does not divide the width.
    """
    found = {value for name, value in fields.search(r"n(um)?_?heads?").items() if isinstance(value, int)}
    heads = found.pop() if len(found) == 1 else config.network.heads
    if found or heads < 1 or config.width % heads:
        raise InvalidFile(f"its number of heads cannot be used: {sorted({heads, *found})}", where=fields.where)
    return replace(config, network=replace(config.network, heads=heads))


ABOUT = """SnapMoGen's published evaluator (Guo et al. 2025, App. B.2): a TMR-like pair of encoders of 296 features, of
which it reads the first 148, and of T5's token states. Trained on SnapMoGen, which may be used for non-commercial
research alone.

Before its numbers are believed, its row of real data should be compared with the published one: R@1 .940, R@2 .976,
R@3 .985, CLIP score .837. A reference of real clips, which `marey eval` needs, is added by
`marey train evaluator reference`."""
NORMALISATION = """Mean and deviation of the data set's `meta_data`, of all 296 features."""
