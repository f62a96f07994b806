"""The public T2M evaluator: read from the public files, which stand in here with random numbers under their names."""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from marey.bundles import Bundle
from marey.core.errors import Conflict, InvalidBundle, InvalidFile, InvalidInput, MareyError, NotFound
from marey.data.prepared import PreparedData
from marey.data.t2m_folder import HUMANML3D_SET, prepare_t2m
from marey.evaluator.loading import load_evaluator
from marey.evaluator.t2m import T2MEvaluator
from marey.evaluator.t2m_import import import_t2m, published_config
from marey.evaluator.t2m_model import T2MConfig, T2MMotionEncoder, T2MTextEncoder
from marey.evaluator.t2m_words import TAGS, TaggedCaptions, WordVectors
from marey.importing import ImportRequest
from tests.support.prepared import write_prepared
from tests.support.t2m_evaluator import SMALL, VOCABULARY, write_public_files
from tests.support.t2m_folder import write_folder

CAPTIONS = {
    "a person walks left": "a/DET person/NOUN walk/VERB left/ADV",
    "a person waves zealously": "a/DET person/NOUN wave/VERB zealously/ADV",
    "walk": "walk/NOUN",
}

# `state_dict` of each network in the public `finest.tar` (momask-codes, models/t2m_eval_modules.py and its wrapper)
PUBLIC = {
    "movement_encoder": {
        "main.0.weight": (512, 259, 4), "main.0.bias": (512,), "main.3.weight": (512, 512, 4), "main.3.bias": (512,),
        "out_net.weight": (512, 512), "out_net.bias": (512,),
    },
    "text_encoder": {
        "hidden": (2, 1, 512), "pos_emb.weight": (300, 15), "pos_emb.bias": (300,),
        "input_emb.weight": (512, 300), "input_emb.bias": (512,),
        "gru.weight_ih_l0": (1536, 512), "gru.weight_hh_l0": (1536, 512), "gru.bias_ih_l0": (1536,),
        "gru.bias_hh_l0": (1536,), "gru.weight_ih_l0_reverse": (1536, 512), "gru.weight_hh_l0_reverse": (1536, 512),
        "gru.bias_ih_l0_reverse": (1536,), "gru.bias_hh_l0_reverse": (1536,),
        "output_net.0.weight": (512, 1024), "output_net.0.bias": (512,), "output_net.1.weight": (512,),
        "output_net.1.bias": (512,), "output_net.3.weight": (512, 512), "output_net.3.bias": (512,),
    },
    "motion_encoder": {
        "hidden": (2, 1, 1024), "input_emb.weight": (1024, 512), "input_emb.bias": (1024,),
        "gru.weight_ih_l0": (3072, 1024), "gru.weight_hh_l0": (3072, 1024), "gru.bias_ih_l0": (3072,),
        "gru.bias_hh_l0": (3072,), "gru.weight_ih_l0_reverse": (3072, 1024), "gru.weight_hh_l0_reverse": (3072, 1024),
        "gru.bias_ih_l0_reverse": (3072,), "gru.bias_hh_l0_reverse": (3072,),
        "output_net.0.weight": (1024, 2048), "output_net.0.bias": (1024,), "output_net.1.weight": (1024,),
        "output_net.1.bias": (1024,), "output_net.3.weight": (512, 1024), "output_net.3.bias": (512,),
    },
}  # fmt: skip

State = Mapping[str, torch.Tensor]


def request(folder: Path, output: Path) -> ImportRequest:
    return ImportRequest("t2m-evaluator", folder, output, "LicenseRef-AMASS-NC")


def import_small(folder: Path, output: Path) -> Bundle:
    return import_t2m(request(folder, output), SMALL)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The public folders in small, with random numbers."""
    root = write_public_files(tmp_path_factory.mktemp("t2m"))
    (root / "texts").mkdir()
    lines = [f"{caption}#{words}#0.0#0.0" for caption, words in CAPTIONS.items()]
    (root / "texts" / "000000.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return root


@pytest.fixture(scope="module")
def bundle(files: Path) -> Bundle:
    import_small(files, files / "t2m-small")
    return Bundle.open(files / "t2m-small")


@pytest.fixture(scope="module")
def evaluator(bundle: Bundle, files: Path) -> T2MEvaluator:
    return T2MEvaluator.load(bundle, device="cpu", tagger=TaggedCaptions.read(files / "texts"))


@pytest.fixture(scope="module")
def checkpoint(files: Path) -> dict[str, State]:
    return torch.load(files / "text_mot_match" / "model" / "finest.tar", weights_only=True)


def motion(frames: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(frames, 263)).astype(np.float32)


# -- the networks written out step by step -----------------------------------------------------------------------------


def linear(state: State, name: str, x: torch.Tensor) -> torch.Tensor:
    return x @ state[f"{name}.weight"].T + state[f"{name}.bias"]


def gru_end(state: State, x: torch.Tensor, suffix: str, hidden: torch.Tensor) -> torch.Tensor:
    """The last state (H,) of one direction over (S, inputs), gate by gate: reset, update, new."""
    for row in x:
        given = state[f"gru.weight_ih_l0{suffix}"] @ row + state[f"gru.bias_ih_l0{suffix}"]
        kept = state[f"gru.weight_hh_l0{suffix}"] @ hidden + state[f"gru.bias_hh_l0{suffix}"]
        (r_in, z_in, n_in), (r_kept, z_kept, n_kept) = given.chunk(3), kept.chunk(3)
        reset, update = (r_in + r_kept).sigmoid(), (z_in + z_kept).sigmoid()
        hidden = (1 - update) * (n_in + reset * n_kept).tanh() + update * hidden
    return hidden


def recurrent(state: State, x: torch.Tensor) -> torch.Tensor:
    x = linear(state, "input_emb", x)
    ends = (("", x, 0), ("_reverse", x.flip(0), 1))
    both = torch.cat([gru_end(state, order, suffix, state["hidden"][k, 0]) for suffix, order, k in ends])
    x = linear(state, "output_net.0", both)
    x = F.layer_norm(x, x.shape, state["output_net.1.weight"], state["output_net.1.bias"])
    return linear(state, "output_net.3", F.leaky_relu(x, 0.2))


def embedded_by_hand(files: Path, checkpoint: Mapping[str, State], features: np.ndarray) -> torch.Tensor:
    mean, std = (np.load(files / "Comp_v6_KLD005" / "meta" / f"{n}.npy").astype(np.float32) for n in ("mean", "std"))
    frames = len(features) // 4 * 4
    padded = torch.zeros(196, 263)
    padded[:frames] = torch.from_numpy((features[:frames] - mean) / std)
    state = checkpoint["movement_encoder"]
    x = padded[:, :259].T[None]
    for name in ("main.0", "main.3"):
        x = F.leaky_relu(F.conv1d(x, state[f"{name}.weight"], state[f"{name}.bias"], stride=2, padding=1), 0.2)
    steps = linear(state, "out_net", x[0].T)[: frames // 4]
    return recurrent(checkpoint["motion_encoder"], steps)


@pytest.mark.parametrize("frames", [4, 7, 40, 75, 196])
def test_a_motion_is_embedded_as_the_public_networks_do_written_out_step_by_step(
    evaluator: T2MEvaluator, files: Path, checkpoint: dict[str, State], frames: int
) -> None:
    features = motion(frames, frames)
    expected = embedded_by_hand(files, checkpoint, features)
    np.testing.assert_allclose(evaluator.embed_motion([features])[0], expected.numpy(), atol=1e-5)


def test_a_sentence_is_embedded_as_the_public_networks_do_written_out_step_by_step(
    evaluator: T2MEvaluator, files: Path, checkpoint: dict[str, State]
) -> None:
    table = np.load(files / "glove" / "our_vab_data.npy").astype(np.float32)
    index = pickle.loads((files / "glove" / "our_vab_idx.pkl").read_bytes())
    # `left` has a tag of its own; an unknown word loses its tag with its vector
    read = {
        "a person walks left": [
            ("sos", "OTHER"), ("a", "DET"), ("person", "NOUN"), ("walk", "Act_VIP"), ("left", "Loc_VIP"),
            ("eos", "OTHER"),
        ],
        "a person waves zealously": [
            ("sos", "OTHER"), ("a", "DET"), ("person", "NOUN"), ("wave", "VERB"), ("unk", "OTHER"), ("eos", "OTHER"),
        ],
    }  # fmt: skip
    state = checkpoint["text_encoder"]
    for sentence, words in read.items():
        vectors = torch.from_numpy(np.stack([table[index[word]] for word, _ in words]))
        tags = F.one_hot(torch.tensor([TAGS.index(tag) for _, tag in words]), 15).float()
        expected = recurrent(state, vectors + linear(state, "pos_emb", tags))
        np.testing.assert_allclose(evaluator.embed_text([sentence])[0], expected.numpy(), atol=1e-5)


# -- the port ----------------------------------------------------------------------------------------------------------


def test_names_and_shapes_are_those_of_the_public_checkpoint() -> None:
    with torch.device("meta"):
        encoder, text = T2MMotionEncoder(T2MConfig()), T2MTextEncoder(T2MConfig())
    ours = {"movement_encoder": encoder.movement, "text_encoder": text, "motion_encoder": encoder.motion}
    for name, network in ours.items():
        assert {key: tuple(value.shape) for key, value in network.state_dict().items()} == PUBLIC[name], name


def test_embeddings_come_in_the_order_given_and_not_by_length(evaluator: T2MEvaluator) -> None:
    motions = [motion(frames, frames) for frames in (24, 196, 60, 8, 130)]
    together = evaluator.embed_motion(motions)
    alone = np.concatenate([evaluator.embed_motion([each]) for each in motions])
    np.testing.assert_allclose(together, alone, atol=1e-5)
    said = list(CAPTIONS)
    sentences = evaluator.embed_text(said)
    np.testing.assert_allclose(sentences[::-1], evaluator.embed_text(said[::-1]), atol=1e-5)
    assert np.abs(together[0] - together[1]).max() > 1e-3
    assert np.abs(sentences[0] - sentences[1]).max() > 1e-3


def test_frames_of_an_incomplete_step_and_contacts_are_not_read_and_all_others_are(evaluator: T2MEvaluator) -> None:
    features = motion(43)
    before = evaluator.embed_motion([features])
    for frame, number, read in ((42, 5, False), (40, 5, False), (39, 5, True), (0, 258, True), (0, 259, False)):
        changed = features.copy()
        changed[frame, number] += 10
        assert (np.abs(evaluator.embed_motion([changed]) - before).max() > 1e-5) == read, (frame, number)


def test_the_evaluator_says_what_it_reads_and_how_it_compares(bundle: Bundle, files: Path) -> None:
    evaluator = load_evaluator(bundle, device="cpu", captions=files / "texts")
    assert (evaluator.layout, evaluator.fps, evaluator.distance) == ("humanml3d-263", 20, "euclidean")
    assert evaluator.embed_text(["walk"]).shape == (1, evaluator.width)
    assert evaluator.name == bundle.reference


def test_broken_short_and_long_motions_are_refused(evaluator: T2MEvaluator) -> None:
    broken = motion(40)
    broken[3, 1] = np.nan
    with pytest.raises(InvalidInput, match="motion 0: 1 of 40 frames hold NaN"):
        evaluator.embed_motion([broken])
    with pytest.raises(InvalidInput, match="has 3 frames; this evaluator reads 4 to 196"):
        evaluator.embed_motion([motion(3)])
    with pytest.raises(InvalidInput, match="has 200 frames"):
        evaluator.embed_motion([motion(200)])


def test_a_sentence_without_tags_is_refused(evaluator: T2MEvaluator, bundle: Bundle) -> None:
    with pytest.raises(InvalidInput, match="a person jumps: is not one of the captions whose words are tagged"):
        evaluator.embed_text(["walk", "a person jumps"])
    with pytest.raises(InvalidInput, match="loaded without a tagger"):
        load_evaluator(bundle, device="cpu").embed_text(["walk"])


# -- words -------------------------------------------------------------------------------------------------------------


def test_a_sentence_is_cut_after_twenty_words_between_its_start_and_end() -> None:
    words = WordVectors({word: row for row, word in enumerate(VOCABULARY)}, np.eye(8, dtype=np.float32))
    vectors, tags = words.read([("walk", "VERB")] * 19 + [("person", "NOUN"), ("wave", "VERB")])
    assert vectors.shape == (22, 8)
    assert [VOCABULARY[int(row.argmax())] for row in vectors] == ["sos", *["walk"] * 19, "person", "eos"]
    assert tags.sum() == 22
    assert TAGS[int(words.read([("person", "no such tag")])[1][1].argmax())] == "OTHER"


def test_a_caption_line_is_read_with_slashes_in_its_words(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("he walks/runs.#he/PRON walk/run/VERB#0.0#3.5\n")
    assert TaggedCaptions.read(tmp_path).tag(" he walks/runs.") == (("he", "PRON"), ("walk/run", "VERB"))


@pytest.mark.parametrize("line", ["he walks", "he walks#he walks#0.0#0.0", "he#he/PRON#0.0"])
def test_a_line_that_is_no_caption_is_refused(line: str, tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(line)
    with pytest.raises(InvalidFile, match=r"a\.txt:1: is not a line"):
        TaggedCaptions.read(tmp_path)


def test_tags_are_those_of_prepared_data_as_well(tmp_path: Path) -> None:
    prepare_t2m(HUMANML3D_SET, write_folder(tmp_path / "published"), tmp_path / "out")
    tagger = TaggedCaptions.of(PreparedData.open(tmp_path / "out"))
    assert tagger.tag("a person crouches") == (("a", "DET"), ("person", "NOUN"), ("crouch", "VERB"))
    write_prepared(tmp_path / "own", clips=6)
    with pytest.raises(InvalidFile, match="no captions with parts of speech"):
        TaggedCaptions.of(PreparedData.open(tmp_path / "own"))


def test_a_folder_without_captions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="holds no captions"):
        TaggedCaptions.read(tmp_path)


# -- importing ---------------------------------------------------------------------------------------------------------


def test_the_public_sizes_follow_from_the_width_of_the_statistics(tmp_path: Path) -> None:
    np.save(tmp_path / "mean.npy", np.zeros(251))
    assert published_config(tmp_path / "mean.npy").layout == "kit-251"
    np.save(tmp_path / "mean.npy", np.zeros(263))
    assert published_config(tmp_path / "mean.npy") == T2MConfig()
    np.save(tmp_path / "mean.npy", np.zeros(296))
    with pytest.raises(InvalidFile, match=r"has shape \(296,\)"):
        published_config(tmp_path / "mean.npy")


def test_the_bundle_holds_weights_words_and_statistics_in_full_precision(
    bundle: Bundle, checkpoint: dict[str, State]
) -> None:
    assert set(bundle.manifest.parts) == {"motion", "text", "words", "statistics"}
    assert not bundle.manifest.commercial
    stored = bundle.tensors("motion", dtype=None)
    for name, value in checkpoint["motion_encoder"].items():
        np.testing.assert_array_equal(stored[f"motion.{name}"], value.numpy())


@pytest.mark.slow
@pytest.mark.parametrize("zipped", [False, True])
def test_files_of_exactly_the_public_names_shapes_and_entries_become_an_evaluator(
    files: Path, tmp_path: Path, zipped: bool
) -> None:
    """As `TextMotionMatchTrainer.save` writes them (EricGuo5513/text-to-motion, networks/trainers.py), by a torch that
    zips files and by one that does not yet. Filled from the list of shapes above, not by our networks."""
    torch.manual_seed(0)
    drawn = {name: {k: 0.02 * torch.randn(shape) for k, shape in shapes.items()} for name, shapes in PUBLIC.items()}
    optimizer = torch.optim.Adam([torch.nn.Parameter(torch.ones(3))])
    optimizer.param_groups[0]["params"][0].grad = torch.ones(3)
    optimizer.step()
    state = {
        "text_encoder": drawn["text_encoder"],
        "motion_encoder": drawn["motion_encoder"],
        "movement_encoder": drawn["movement_encoder"],
        "opt_text_encoder": optimizer.state_dict(),
        "opt_motion_encoder": optimizer.state_dict(),
        "epoch": 148,
        "iter": 54000,
    }
    file = tmp_path / "text_mot_match" / "model" / "finest.tar"
    file.parent.mkdir(parents=True)
    torch.save(state, file, _use_new_zipfile_serialization=zipped)
    (tmp_path / "Comp_v6_KLD005").symlink_to(files / "Comp_v6_KLD005")
    glove = tmp_path / "glove"
    glove.mkdir()
    for name in ("our_vab_words.pkl", "our_vab_idx.pkl"):
        (glove / name).write_bytes((files / "glove" / name).read_bytes())
    np.save(glove / "our_vab_data.npy", np.random.default_rng(1).normal(size=(len(VOCABULARY) + 3, 300)))
    made = import_t2m(request(tmp_path, tmp_path / "bundle"))
    evaluator = load_evaluator(made, device="cpu", captions=files / "texts")
    features = motion(75)
    expected = embedded_by_hand(files, drawn, features)
    np.testing.assert_allclose(evaluator.embed_motion([features])[0], expected.numpy(), atol=1e-4)
    assert evaluator.embed_text(list(CAPTIONS)).shape == (3, 512)


@pytest.fixture
def download(files: Path, tmp_path: Path) -> Path:
    """A copy of the public folders that a test may break, as they lie in the download."""
    root = tmp_path / "download"
    for name in ("text_mot_match", "Comp_v6_KLD005"):
        shutil.copytree(files / name, root / "checkpoints" / "t2m" / name)
    shutil.copytree(files / "glove", root / "glove")
    return root


@pytest.mark.parametrize("named", [".", "checkpoints", "checkpoints/t2m"])
def test_the_folder_of_the_download_is_found_from_any_of_its_levels(
    download: Path, bundle: Bundle, tmp_path: Path, named: str
) -> None:
    made = import_small(download / named, tmp_path / "bundle")
    assert made.weights_sha256 == bundle.weights_sha256
    card = (tmp_path / "bundle" / "README.md").read_text(encoding="utf-8")
    assert "text_mot_match/model/finest.tar" in card


def test_a_pickle_that_asks_for_a_class_is_refused_and_not_run(download: Path, tmp_path: Path) -> None:
    class Evil:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "touched",))

    (download / "glove" / "our_vab_words.pkl").write_bytes(pickle.dumps([Evil()]))
    with pytest.raises(InvalidFile, match="is not a plain list or dictionary: refused"):
        import_small(download, tmp_path / "bundle")
    assert not (tmp_path / "touched").exists()
    assert not (tmp_path / "bundle").exists()


def break_download(download: Path, change: str) -> None:
    file = download / "checkpoints" / "t2m" / "text_mot_match" / "model" / "finest.tar"
    weights = torch.load(file, weights_only=True)
    if change == "missing weights":
        file.unlink()
    elif change == "missing words":
        shutil.rmtree(download / "glove")
    elif change == "truncated":
        file.write_bytes(file.read_bytes()[:500])
    elif change == "nan":
        weights["text_encoder"]["hidden"][0, 0, 0] = torch.nan
        torch.save(weights, file)
    elif change == "list":
        torch.save([1, 2], file)
    elif change == "pickled":
        torch.save(torch.nn.Linear(2, 2), file)
    elif change == "unknown":
        torch.save({**weights, "more": {"weight": torch.ones(2)}}, file)
    elif change == "statistics":
        np.save(download / "checkpoints" / "t2m" / "Comp_v6_KLD005" / "meta" / "std.npy", np.ones(262))
    elif change == "vectors":
        np.save(download / "glove" / "our_vab_data.npy", np.zeros((4, 5)))


@pytest.mark.parametrize(
    ("change", "kind", "said"),
    [
        ("missing weights", NotFound, r"the evaluator is missing: there is no text_mot_match/model/finest\.tar"),
        ("missing words", NotFound, r"the folder of word vectors is missing: there is no glove or \.\./glove"),
        ("truncated", InvalidFile, "truncated"),
        ("nan", InvalidFile, "hidden holds NaN"),
        ("list", InvalidFile, "holds list, not a dictionary"),
        ("pickled", InvalidFile, "holds code or objects of Python"),
        ("unknown", InvalidFile, "holds tensors that this import does not know: more"),
        ("statistics", InvalidFile, r"has shape \(262,\), not \(263\)"),
        ("vectors", InvalidFile, "has 4 vectors, which do not fit the words"),
    ],
)
def test_a_broken_download_is_refused_and_leaves_nothing(
    download: Path, tmp_path: Path, change: str, kind: type[MareyError], said: str
) -> None:
    break_download(download, change)
    with pytest.raises(kind, match=said) as caught:
        import_small(download, tmp_path / "models" / "bundle")
    assert caught.value.where
    assert not (tmp_path / "models").exists()


def test_a_checkpoint_of_other_sizes_is_refused_and_a_bundle_is_not_replaced(files: Path, tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match=r"main\.0\.weight has shape \(12, 259, 4\), not \(512, 259, 4\)"):
        import_t2m(request(files, tmp_path / "bundle"))
    with pytest.raises(Conflict):
        import_small(files, files / "t2m-small")


def test_a_bundle_of_another_evaluator_or_layout_is_refused(bundle: Bundle) -> None:
    for changes, message in (({"model": "tmr"}, "not an evaluator of t2m"), ({"layout": "kit-251"}, "not kit-251")):
        with pytest.raises(InvalidBundle, match=message):
            T2MEvaluator.load(Bundle(bundle.path, bundle.manifest.model_copy(update=changes)), device="cpu")
