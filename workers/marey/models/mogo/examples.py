"""Choice of the example prompts of `/live`: those that a MOGO bundle follows best while it streams.

    python -m marey.models.mogo.examples models/mogo-starter

Candidates are short prompts of one action from the evaluation sets. Each begins sessions, and each is the second prompt
of sessions with another action; the checker judges both from the joints of the live frames. The best prompt of each
action becomes an example if at least `LEAST` of its sessions pass. Results are kept per exact bundle.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from marey.bundles import find_bundle
from marey.checks.prompts import HeldOutPrompt, evaluation_prompts
from marey.core.checkout import checkout
from marey.core.errors import MareyError
from marey.models.mogo.adherence import AFTER, BEFORE, SESSIONS, played, steered
from marey.models.mogo.generate import Generator
from marey.models.mogo.live import LiveSessionPool
from marey.text.features import TextFeatures
from marey.training.adherence import pipeline_of

OUTPUT = Path("workers", "marey", "models", "mogo", "examples.json")
"""Path in the checkout."""
SETS = ("evaluation", "development")
CANDIDATES = 3
"""Prompts per action."""
LONGEST = 48
"""Characters: an example is read at a glance."""
LEAST = 0.9
SEEDS = 4

Act = tuple[str, str]
"""An action and its side."""


def candidates() -> list[HeldOutPrompt]:
    """Return the shortest prompts of each action that are not in the training data."""
    by_act: dict[Act, list[HeldOutPrompt]] = defaultdict(list)
    for prompt in sorted(itertools.chain(*map(evaluation_prompts, SETS)), key=lambda p: len(p.text)):
        named = prompt.text.startswith(("a person", "someone", "somebody"))
        if len(prompt.expected) == 1 and not prompt.separate and len(prompt.text) <= LONGEST and named:
            act = act_of(prompt)
            if len(by_act[act]) < CANDIDATES:
                by_act[act].append(prompt)
    return [prompt for prompts in by_act.values() for prompt in prompts]


def act_of(prompt: HeldOutPrompt) -> Act:
    """Return the action that a prompt asks for."""
    return prompt.expected[0].act, prompt.expected[0].side


def pairs(prompts: Sequence[HeldOutPrompt], seeds: int) -> list[tuple[HeldOutPrompt, HeldOutPrompt]]:
    """Pair prompts of different actions, so that each comes first and second in `seeds` sessions."""
    count, found = len(prompts), list[tuple[HeldOutPrompt, HeldOutPrompt]]()
    steps = (CANDIDATES + (count // seeds) * k for k in itertools.count())
    while len(found) < seeds * count:
        step = next(steps) % count
        some = [(prompt, prompts[(k + step) % count]) for k, prompt in enumerate(prompts)]
        found += [pair for pair in some if act_of(pair[0]) != act_of(pair[1])]
    return found


def measure(
    generator: Generator, sessions: Sequence[tuple[HeldOutPrompt, HeldOutPrompt]], texts: dict[str, TextFeatures]
) -> dict[str, list[bool]]:
    """Return for each prompt if it passed within 2 s, as a first prompt and as a steer."""
    fps = generator.limits.fps
    obeyed: dict[str, list[bool]] = defaultdict(list)
    for start in range(0, len(sessions), SESSIONS):
        some = sessions[start : start + SESSIONS]
        pool = LiveSessionPool(generator, len(some))
        names = [pool.start(texts[first.text], start + k) for k, (first, _) in enumerate(some)]
        before = played(pool, names, round((BEFORE + 1) * fps))
        for name, (_, second) in zip(names, some, strict=True):
            pool.steer(name, texts[second.text])
        after = played(pool, names, round(AFTER * fps))
        for k, pair in enumerate(some):
            for joints, prompt in zip((before[k], after[k]), pair, strict=True):
                obeyed[prompt.text].append(steered(joints, fps, prompt).passed)
        print(f"{start + len(some)} of {len(sessions)} sessions", file=sys.stderr, flush=True)  # noqa: T201
    return obeyed


def choose(prompts: Sequence[HeldOutPrompt], obeyed: dict[str, list[bool]]) -> list[dict[str, Any]]:
    """Choose the best prompt of each action: first one per action, then its other sides; highest share first."""
    best: dict[Act, dict[str, Any]] = {}
    for prompt in prompts:
        sessions = obeyed[prompt.text]
        row = {"prompt": prompt.text, "obeyed": sum(sessions), "sessions": len(sessions)}
        share = row["obeyed"] / row["sessions"]
        known = best.get(act_of(prompt))
        if share >= LEAST and (known is None or share > known["obeyed"] / known["sessions"]):
            best[act_of(prompt)] = row
    seen: Counter[str] = Counter()
    ranked: list[tuple[int, float, dict[str, Any]]] = []
    for (act, _), row in best.items():
        ranked.append((seen[act], -row["obeyed"] / row["sessions"], row))
        seen[act] += 1
    return [row for *_, row in sorted(ranked, key=lambda each: each[:2])]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure one bundle and write its examples beside those of other bundles."""
    parser = argparse.ArgumentParser(prog="python -m marey.models.mogo.examples")
    parser.add_argument("bundle")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="sessions that begin with each prompt")
    parser.add_argument("--threads", type=int, default=0)
    root = checkout()
    parser.add_argument("-o", "--output", type=Path, default=root and root / OUTPUT, required=root is None)
    chosen = parser.parse_args(arguments)
    reference = find_bundle(chosen.bundle).reference
    generator = Generator.load(chosen.bundle, threads=chosen.threads)
    prompts = candidates()
    words = [prompt.text for prompt in prompts]
    texts = dict(zip(words, pipeline_of(generator).features(words), strict=True))
    obeyed = measure(generator, pairs(prompts, chosen.seeds), texts)
    kept = json.loads(chosen.output.read_text("utf-8")) if chosen.output.exists() else {}
    kept[reference] = choose(prompts, obeyed)
    chosen.output.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    try:
        main()
    except MareyError as error:
        sys.exit(f"{error}")
