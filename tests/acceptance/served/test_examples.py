"""The scripts of `examples/`, each as a user runs it, against a real server."""

from __future__ import annotations

from pathlib import Path

from marey.motion import load_npz, read_bvh
from tests.support.forking import forks
from tests.support.marey import REPOSITORY, TINY, Marey

EXAMPLES = REPOSITORY / "examples"


def run(marey: Marey, folder: Path, script: str, *arguments: object, code: int = 0, timeout: float = 120) -> str:
    """Run a script in a folder; what it printed, on stderr if it is to fail."""
    words, path = list(map(str, arguments)), EXAMPLES / script
    ended, out, err = forks().run(words, marey.environ(), folder, b"", timeout, script=path)
    assert ended == code, f"exit {ended}\n{out.decode()}\n{err.decode()}"
    return (err if code else out).decode()


def test_a_csv_is_submitted_and_fetched(elsewhere: Marey, tmp_path: Path) -> None:
    (tmp_path / "prompts.csv").write_text("prompt,seed\na person walks,3\na person waves,4\n")
    out = run(elsewhere, tmp_path, "submit_csv.py", "prompts.csv", "clips").splitlines()
    assert out == ["3 clips/00000_a-person-walks_3.bvh", "4 clips/00001_a-person-waves_4.bvh"]
    for line in out:
        assert (tmp_path / line.partition(" ")[2]).read_text().startswith("HIERARCHY")
    assert (tmp_path / "clips" / "manifest.csv").exists()


def test_a_csv_with_mistakes_names_their_lines(elsewhere: Marey, tmp_path: Path) -> None:
    (tmp_path / "prompts.csv").write_text("prompt,seed\na person walks,3\na person waves,minus one\n")
    said = run(elsewhere, tmp_path, "submit_csv.py", "prompts.csv", "clips", code=2)
    assert said == "line 3: seed: is 'minus one', not a whole number\n"


def test_a_job_is_watched_with_its_progress(elsewhere: Marey, tmp_path: Path) -> None:
    out = run(elsewhere, tmp_path, "watch_job.py").splitlines()
    assert out[0] == "would make 4 motions"
    assert "succeeded: 4 of 4" in out
    assert all(line.rstrip().endswith("succeeded") for line in out[-4:])
    assert any(line.startswith("a person bows deeply 8") for line in out)


def test_motions_are_searched_kept_and_rerolled(elsewhere: Marey, tmp_path: Path) -> None:
    rows = "prompt,seconds,tags\na person walks,2,shot=9\na person waves,3,shot=9\na person bows,4,shot=9\n"
    elsewhere("submit", "-f", "-", "--watch", stdin=rows).ok()
    out = run(elsewhere, tmp_path, "search_and_review.py", "shot=9", "kept").splitlines()
    assert out[0].startswith("kept 'a person waves', seed ")
    assert out[0].endswith(", 3 s")
    assert [line.split()[0] for line in out[1:3]] == ["seed", "it"]
    assert [path.name for path in (tmp_path / "kept").glob("*.npz")] == [Path(out[-1]).name]
    assert load_npz(tmp_path / out[-1]).seconds == 3
    assert "rerolled" in elsewhere("motions", "list", "--tag", "shot=9", "--review", "rerolled", "--json").ok().out
    assert run(elsewhere, tmp_path, "search_and_review.py", "shot=none", "kept") == "nothing is left to review\n"


def test_a_live_stream_is_steered_and_written(elsewhere: Marey, tmp_path: Path) -> None:
    out = run(elsewhere, tmp_path, "live_to_bvh.py", "walk.bvh").splitlines()
    assert out[0].startswith("frame 19: prompt 0, at ")
    assert out[-3:] == ["ended: 80 frames, 0 missing", "a person walks forward", "a person waves with the right hand"]
    assert read_bvh(tmp_path / "walk.bvh", rest_frame="keep").root.shape == (80, 3)


def test_two_runs_are_evaluated_and_compared(elsewhere: Marey, tmp_path: Path) -> None:
    out = run(elsewhere, tmp_path, "evaluate.py", TINY, timeout=400).splitlines()
    assert {"before: done, 1 of 1", "after: done, 1 of 1"} <= set(out)
    assert any(" -> " in line and line.endswith(("(better)", "(worse)", "(no difference found)")) for line in out)
    assert out[-1].startswith("#")


def test_a_motion_is_made_here_cut_and_converted(elsewhere: Marey, tmp_path: Path) -> None:
    out = run(elsewhere, tmp_path, "generate_locally.py", "a person waves", "wave", TINY).splitlines()
    assert out[0].startswith(f"40 frames of 2 s by {TINY}@")
    assert out[1:] == ["20 frames are left", "40 frames came back at 20 a second"]
    same = tmp_path / "same"
    elsewhere("generate", "a person waves", "--seed", 1, "--seconds", 2, "--model", TINY, "-o", same).ok()
    (npz,) = same.glob("*.npz")
    assert npz.read_bytes() == (tmp_path / "wave.npz").read_bytes()
