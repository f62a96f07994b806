"""Bodies, answers and messages of live streams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal
from uuid import UUID

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from marey.api.jobs.schemas import ErrorView
from marey.bundles import Bundle
from marey.bundles.body import body_of
from marey.http.fields import ITEM_MODEL, ITEM_NAME, PROMPT
from marey.http.problems import ProblemBody
from marey.http.schemas import View
from marey.items.values import MAX_SEED
from marey.motion.skeleton import Skeleton
from marey.streams import StreamPrompt, StreamRow, StreamState
from marey.streams.states import WaitsFor
from marey.vocabulary.report import warn_of
from marey.vocabulary.scope import ActionLists

MIN_SECONDS, MAX_SECONDS = 1.0, 600.0
DIGITS = 6
"""Digits of offsets: a thousandth of a millimetre."""
GONE = "null if the bundle no longer exists on the server."


class NewStreamBody(BaseModel):
    """A live stream to create; fields shared with items have the same rules."""

    model_config = ConfigDict(extra="forbid", strict=True)

    prompt: str = Field(
        min_length=1,
        description="What the person does first, in English, at most 200 words.",
        json_schema_extra=PROMPT,
    )
    name: str | None = Field(
        None, description="File name of the clip, without its extension.", json_schema_extra=ITEM_NAME
    )
    model: str | None = Field(
        None,
        description="Model, bundle or exact bundle that can make motion frame by frame. None = the server's choice.",
        json_schema_extra=ITEM_MODEL,
    )
    seed: int | None = Field(None, ge=0, le=MAX_SEED, description="Random by default.")
    seconds: float = Field(MAX_SECONDS, ge=MIN_SECONDS, le=MAX_SECONDS, description="Seconds after which it ends.")


class EndStreamBody(BaseModel):
    """The end of a live stream."""

    model_config = ConfigDict(extra="forbid", strict=True)

    pose: dict[str, Any] = Field(
        description="Pose of the last frame, as the fields of a pose keyframe: `motion` with the `id` of a stored "
        "motion and a `frame` of it, or `joint_rotations` and `root_height`. The stream shows it a second later, where "
        "the body is and faces then.",
    )


class SkeletonView(View):
    """The joints that frames rotate."""

    names: list[str]
    parents: list[int] = Field(description="Index of each joint's parent, which comes before it; -1 for the root.")
    offsets: list[tuple[float, float, float]] = Field(
        description="The rest pose: metres from the parent, Y up, facing +Z; the root's own from the floor."
    )

    @classmethod
    def of(cls, skeleton: Skeleton) -> SkeletonView:
        """Convert the skeleton of a body."""
        places = np.round(skeleton.offsets.astype(np.float64), DIGITS) + 0.0  # no -0.0
        offsets = [(x, y, z) for x, y, z in places.tolist()]
        return cls(names=list(skeleton.joint_names), parents=list(skeleton.parents), offsets=offsets)


@dataclass(frozen=True)
class BundleFacts:
    """Data of a stream's bundle; empty if the bundle no longer exists here."""

    licence: str | None = None
    fps: float | None = None
    skeleton: SkeletonView | None = None
    name: str = ""
    actions: ActionLists | None = None

    @classmethod
    def by(cls, bundle: Bundle) -> BundleFacts:
        """Read a bundle."""
        manifest = bundle.manifest
        skeleton = None if manifest.layout is None else SkeletonView.of(body_of(manifest).skeleton)
        return cls(manifest.licence, manifest.fps, skeleton, manifest.name, manifest.actions)


class PromptView(View):
    """A prompt, and the frame from which it is in force."""

    number: int = Field(description="Number as in frames, from 0; each steer adds one.")
    frame: int
    prompt: str
    rewritten: str | None = Field(description="Text that the model received; null if not recorded.")
    not_rewritten: str | None = Field(description="Reason why a rewrite was not used.")
    warnings: list[str] = Field(description="Sentences on what the model does not know of it, by its words.")

    @classmethod
    def of(cls, number: int, recorded: StreamPrompt, made: BundleFacts) -> PromptView:
        """Convert a recorded prompt."""
        rewritten, reason = (None, None) if recorded.read is None else recorded.read
        return cls(
            number=number,
            frame=recorded.frame,
            prompt=recorded.prompt,
            rewritten=rewritten,
            not_rewritten=reason,
            warnings=warn_of(recorded.prompt, made.name, made.actions) if recorded.prompt else [],
        )


class StreamView(View):
    """A live stream."""

    id: UUID
    name: str | None
    prompt: str
    model: str
    bundle: str
    licence: str | None = Field(description=f"Terms of the weights; {GONE}")
    seed: int
    state: StreamState
    position: int | None = Field(description="Number of streams before it; null if it does not wait.")
    waits_for: WaitsFor | None = Field(
        description="What it waits for: a `slot` of a worker, or a `worker` that has loaded its bundle, as none has."
    )
    reason: str | None = Field(description="Reason of its end.")
    error: ErrorView | None
    fps: float | None = Field(description=f"Frames a second; {GONE}")
    frames: int = Field(description="Recorded frames: at most a second less than shown.")
    max_frames: int
    job: UUID | None = Field(description="Job of the clip.")
    created: datetime
    started: datetime | None
    ended: datetime | None

    @classmethod
    def of(cls, row: StreamRow, made: BundleFacts) -> StreamView:
        """Convert a row."""
        return cls(**_fields(row, made))


class StreamDetailView(StreamView):
    """A live stream with its recorded prompts and its skeleton."""

    prompts: list[PromptView]
    skeleton: SkeletonView | None = Field(description=f"Skeleton of the frames; {GONE}")

    @classmethod
    def detail(cls, row: StreamRow, made: BundleFacts, prompts: Sequence[StreamPrompt]) -> StreamDetailView:
        """Convert a row, and its prompts with the frame each is in force from."""
        recorded = [PromptView.of(number, prompt, made) for number, prompt in enumerate(prompts)]
        return cls(prompts=recorded, skeleton=made.skeleton, **_fields(row, made))


class StreamMessage(View):
    """Current state of the stream: sent first on every socket, and whenever state, position, `waits_for` or prompts
    changed."""

    type: Literal["stream"] = "stream"
    stream: StreamDetailView


class GapMessage(View):
    """Frames `first` to `first + count - 1` are not sent."""

    type: Literal["gap"] = "gap"
    first: int
    count: int


class ErrorMessage(View):
    """A message of the client cannot be used, or a dependency is unavailable for now; the socket stays open."""

    type: Literal["error"] = "error"
    problem: ProblemBody


class EndMessage(View):
    """The stream has ended, and the socket closes."""

    type: Literal["end"] = "end"
    stream: StreamDetailView


SocketMessage = StreamMessage | GapMessage | ErrorMessage | EndMessage


def _fields(row: StreamRow, made: BundleFacts) -> dict[str, Any]:
    apart = {"error", "licence", "fps"}
    own = {name: getattr(row, name) for name in StreamView.model_fields if name not in apart}
    error = None if row.problem is None else ErrorView.of(row.problem)
    return {**own, "error": error, "licence": made.licence, "fps": made.fps}
