"""Import TMR's published evaluator: weights, configuration and statistics become a bundle.

    marey models import tmr FOLDER -o BUNDLE --text-encoder DISTILBERT --licence LICENCE

FOLDER is one model of the published archive, or a folder of one that its training wrote:

    tmr_humanml3d_guoh3dfeats/
        config.json                                      sizes, data set and text encoder
        last_weights/{motion_encoder,text_encoder}.pt    or logs/checkpoints/last.ckpt, with all networks

The statistics, `stats/DATASET/guoh3dfeats/{mean,std}.pt`, are files of the repository and not of the archive: the
folder `stats` lies in FOLDER, beside it, or two folders above it as in the repository. All data sets are read as
HumanML3D's features, KIT-ML as well.

Names, sizes and the order of computation: Mathux/TMR (MIT). It has never run on the public weights.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from marey.bundles import Bundle, DataSource
from marey.core.errors import InvalidFile
from marey.evaluator.bundle import write_bundle
from marey.evaluator.config import EvaluatorConfig, NetworkConfig
from marey.evaluator.model import MotionEncoder, SentenceEncoder
from marey.evaluator.published_names import published_name
from marey.evaluator.tmr_published import ENCODER, MODEL, PUBLIC
from marey.importing import Download, Fields, ImportRequest, Section, make_card, provenance, text_encoder_of

FOLDERS = ("tmr_*", "models/tmr_*")
"""Folders of models in the repository."""
EXTRACTED, TRAINED = "last_weights", "logs/checkpoints/last.ckpt"
STATS = ("stats", "../stats", "../../stats", "../../../stats")
DATA_SETS = {"humanml3d": "HumanML3D", "kitml": "KIT-ML", "babel": "BABEL"}
FEATURES = "guoh3dfeats"
ENCODER_NAMES = ("distilbert-base-uncased", "distilbert/distilbert-base-uncased")
MAX_SIZE, MAX_COUNT = 8192, 64
"""Limits of widths, and of numbers of layers and heads."""
CREDIT = "Petrovich et al. 2023, TMR: Text-to-Motion Retrieval Using Contrastive 3D Human Motion Synthesis"


def import_tmr(request: ImportRequest) -> Bundle:
    """Import the evaluator of a folder.

    Raises:
        NotFound: a file, or the text encoder, is missing.
        InvalidInput: the folder has several models.
        InvalidFile: a file is damaged, of another kind, or of other sizes than the configuration states.
        Conflict: the bundle already exists.
    """
    download = Download(request.folder)
    folder = download.root
    if not download.has("config.json"):
        folder = download.find(*FOLDERS, what="the folder of the model")
    fields = download.json(download.find("config.json", what="the configuration of the model", within=folder))
    config, data_set = _read_model(fields.section("model")), _read_data(fields.section("data"))
    motion, text = MotionEncoder(config), SentenceEncoder(config)
    _fill(download, folder, motion, text)
    stats = [f"{place}/{data_set}/{FEATURES}" for place in STATS]
    found = download.find(*stats, what=f"the folder of the statistics of {data_set}", within=folder)
    statistics = download.statistics(found, config.features, ending="pt")
    accounts = download.finish()
    name = DATA_SETS[data_set]
    about, normalisation = ABOUT.format(data=name), NORMALISATION.format(data=name)
    with text_encoder_of(request, ENCODER) as spec:
        return write_bundle(
            request.output,
            config,
            {"motion": motion.state_dict(), "text": text.state_dict()},
            statistics,
            None,
            text=spec,
            card=make_card(request, accounts, about=about, normalisation=normalisation, text=spec),
            model=MODEL,
            dtype=np.float32,
            overwrite=request.overwrite,
            licence=request.licence,
            data=(DataSource(name=name, licence=request.licence, credit=CREDIT),),
            training=provenance(request, accounts),
        )


def _fill(download: Download, folder: Path, motion: MotionEncoder, text: SentenceEncoder) -> None:
    """Fill the encoders from a file each, or from the checkpoint of the training, which holds all networks."""
    extracted = (folder / EXTRACTED).is_dir() or not (folder / TRAINED).exists()
    for name, network, made in (("motion_encoder", motion, {}), ("text_encoder", text, text.unchanged)):
        section = _extracted(download, folder, name) if extracted else _trained(download, folder)
        prefix = "" if extracted else f"{name}."
        section.fill(network, lambda own, prefix=prefix: prefix + published_name(own), made=made)
        section.ignore(r"(\w+\.)?sequence_pos_encoding\.pe", "positions, which are computed anew")


def _extracted(download: Download, folder: Path, network: str) -> Section:
    return download.checkpoint(download.find(f"{EXTRACTED}/{network}.pt", what=f"the {network}", within=folder)).whole()


def _trained(download: Download, folder: Path) -> Section:
    checkpoint = download.checkpoint(folder / TRAINED)
    checkpoint.ignore(r"callbacks|loops|lr_schedulers", "state of the training")
    section = checkpoint.section("state_dict")
    section.ignore(r"motion_decoder\..*", "the decoder, which is used in training alone")
    return section


def _read_model(fields: Fields) -> EvaluatorConfig:
    """Return the configuration with the sizes of the networks.

    Raises:
        InvalidFile: another model, or encoders that differ from each other.
    """
    fields.expect("_target_", "src.model.TMR")
    motion, text = (_read_network(fields.section(name)) for name in ("motion_encoder", "text_encoder"))
    if motion != text:
        raise InvalidFile(f"its encoders have different sizes: {motion} and {text}", where=fields.where)
    fields.section("motion_encoder").expect("nfeats", PUBLIC.features)
    fields.section("text_encoder").expect("nfeats", PUBLIC.text_width)
    return replace(PUBLIC, network=motion)


def _read_network(fields: Fields) -> NetworkConfig:
    fields.expect("vae", True)
    fields.expect("activation", "gelu")
    width, heads = fields.size("latent_dim", MAX_SIZE, low=2), fields.size("num_heads", MAX_COUNT)
    if width % heads or width % 2:
        raise InvalidFile(f"num_heads: {heads} heads do not divide a width of {width}", where=fields.where)
    return NetworkConfig(
        layers=fields.size("num_layers", MAX_COUNT),
        heads=heads,
        width=width,
        feedforward=fields.size("ff_size", MAX_SIZE),
    )


def _read_data(fields: Fields) -> str:
    """Return the name of the data set in the repository.

    Raises:
        InvalidFile: other features, another text encoder, or an unknown data set.
    """
    fields.section("text_to_token_emb").expect("modelname", *ENCODER_NAMES)
    loader = fields.section("motion_loader")
    loader.expect("nfeats", PUBLIC.features)
    loader.expect("fps", PUBLIC.fps)
    normalizer = loader.section("normalizer")
    folder = normalizer.text("base_dir")
    parts = folder.replace("\\", "/").rstrip("/").split("/")
    data_set = parts[-2] if len(parts) > 1 else ""
    if data_set not in DATA_SETS or parts[-1] != FEATURES:
        known = ", ".join(f"stats/{name}/{FEATURES}" for name in DATA_SETS)
        raise InvalidFile(f"base_dir: is {folder[:80]!r}; known: {known}", where=normalizer.where)
    return data_set


ABOUT = """TMR's published evaluator (Petrovich et al. 2023), trained on {data} as HumanML3D's 263 features: two
encoders of ACTOR's design, of all numbers of a frame and of DistilBERT's token states. Mean vectors are the embeddings,
compared by cosine. The decoder is used in training alone and is not here. The training data derive from AMASS, which
may be used for non-commercial research alone; the MIT licence of the repository does not mention weights.

Before its numbers are believed, compare a score that the project states, for the weights of HumanML3D: (1 + cosine) / 2
of "a man sets to do a backflips then fails back flip and falls to the ground" and HumanML3D's clip 001034 is about .96.
A reference of real clips, which `marey eval` needs, is added by `marey train evaluator reference`."""
NORMALISATION = """Mean and deviation of the training clips of {data} in these features, from the project's repository.
They are not HumanML3D's `Mean.npy` and `Std.npy`."""
