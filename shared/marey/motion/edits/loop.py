"""`loop`: a cycle of a motion that can be played on and on.

Candidates are pairs of frames with nearly the same pose and movement (`loop_search.py`). Each is closed by a blend
before its end (`loop_blend.py`); the first one that keeps all bars (`loop_bars.py`) is the loop, or
the best of those in which a joint moves most at the seam where all are so. Before a motion is refused, all pairs are
tried, and blends that miss a bar by little are changed (`loop_ease.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.edits.feet import found_contacts
from marey.motion.edits.loop_bars import Bars, Fault
from marey.motion.edits.loop_blend import Closed, closed
from marey.motion.edits.loop_ease import eased
from marey.motion.edits.loop_search import SHORTEST_STILL, Cycle, cycles, has_steps
from marey.motion.edits.place import heading_of, posed
from marey.motion.edits.prompt_frames import with_prompts_at
from marey.motion.edits.timeline_rows import cut_rows
from marey.motion.feet import need_feet
from marey.motion.rotations import about, rotate

TRIED = 100
"""Candidates."""
SLOWER = (0.0, 0.04)
"""Shares of a blend's length that it shows less of the source, tried in this order; 0.04 is slower by 8 percent in the
middle of the blend. In a run hardly a frame lies within the bars by itself."""
STILL = (0.6, 1.0, 1.5, 2.0)
"""Seconds of further blends of a motion without steps: a body that stands shifts its weight by centimetres and hardly
comes back, and its joints move by a millimetre a frame, so that a short blend shows."""


def loop(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Cut a cycle out of a motion.

    Args:
        clip: with known feet, hips and shoulders.
        values: `end`, whether the last frame is the first one again (`closed`) or the one before it (`open`), and
            `blend`, the seconds before the end in which the result may differ from the source.

    Returns:
        The loop; `loop` of its manifest has the frames of the source, the kind of its end, how many of its first and
        last frames are blended, and the travel of a cycle: metres, radians and seconds.

    Raises:
        InvalidInput: no cycle keeps the bars; the message says which bar the nearest one misses.
    """
    need_feet(clip.skeleton)
    contacts = clip.contacts if clip.contacts.any() else found_contacts(clip)
    bars = Bars(clip)
    best: Fault | None = None
    spare: tuple[Closed, Cycle] | None = None
    for window, slower in _blends(clip, contacts, values["blend"]):
        for cycle in cycles(clip, contacts, window, TRIED):
            found = bars.best(closed(clip, contacts, cycle, window, slower * window))
            if isinstance(found, Closed):
                if found.hitch <= 1.0:
                    return _result(clip, found, cycle, values)
                spare = spare if spare and spare[0].hitch <= found.hitch else (found, cycle)
                continue
            best = found if best is None or found.excess < best.excess else best
    if spare:
        return _result(clip, *spare, values)
    for window in dict.fromkeys(window for window, _ in _blends(clip, contacts, values["blend"])):
        for cycle in cycles(clip, contacts, window, TRIED, neighbours=0):
            found = eased(clip, contacts, cycle, window, bars.best)
            if isinstance(found, Closed):
                return _result(clip, found, cycle, values)
            best = found if best is None or found.excess < best.excess else best
    raise _refused(clip, contacts, best)


def _blends(clip: MotionClip, contacts: Any, seconds: float) -> Iterator[tuple[int, float]]:
    """Yield the blends to try in this order: their frames, and the share that they show less of the source."""
    lengths = [seconds] if has_steps(clip, contacts) else [seconds, *(each for each in STILL if each > seconds)]
    for length in lengths:
        for slower in SLOWER if length == seconds else SLOWER[:1]:
            yield max(int(length * clip.fps + 1e-6), 1), slower


def _refused(clip: MotionClip, contacts: Any, best: Fault | None) -> InvalidInput:
    if best is not None:
        return InvalidInput(
            f"the motion has no cycle without a visible seam: in the best one, {best.reason}",
            hint="Generate a longer motion of one steady action, or trim this one to its steady part.",
        )
    if has_steps(clip, contacts):
        return InvalidInput(
            "the motion has no whole gait cycle, a step of each foot",
            hint="Generate a longer one: two steps of each foot or more.",
        )
    return InvalidInput(
        f"the motion has no steps and {clip.seconds:.2f} s; a loop without steps has {SHORTEST_STILL:g} s or more",
        hint="Generate a longer motion.",
    )


def _result(clip: MotionClip, done: Closed, cycle: Cycle, values: Mapping[str, Any]) -> MotionClip:
    """Return the loop, and write it down."""
    frames = cycle.last - cycle.first
    whole = posed(clip, done.rotations, done.root, contacts=done.contacts)
    way = rotate(about("Y", -heading_of(whole, 0)), done.root[-1] - done.root[0])
    record = {
        "end": values["end"],
        "source_frames": [cycle.first - done.earlier, cycle.last - done.earlier],
        "blend_frames": {"first": done.earlier, "last": done.blend - done.earlier},
        "cycle": {
            "seconds": round(frames / clip.fps, 6),
            "x": round(float(way[0]), 6) + 0.0,
            "z": round(float(way[2]), 6) + 0.0,
            "heading": round(done.travel.angle, 6) + 0.0,
        },
    }
    kept = slice(None) if values["end"] == "closed" else slice(-1)
    shown = range(cycle.first - done.earlier, cycle.last - done.earlier + 1)[kept]
    manifest = with_prompts_at(cut_rows(clip.manifest, shown[0], shown[-1], clip.fps), shown)
    return posed(
        whole,
        done.rotations[kept],
        done.root[kept],
        contacts=done.contacts[kept],
        manifest={**manifest, "loop": record},
    )
