"""Live streams: rows of the database, and the messages, frames and recordings that Redis carries."""

from marey.streams.repository import (
    abandoned_streams,
    add_chunk,
    create_stream,
    end_stream,
    get_stream,
    list_streams,
    open_streams,
    prompts_with_rewrites,
    stream_actions,
    stream_prompts,
    take_stream,
)
from marey.streams.states import StreamState
from marey.streams.types import NewStream, StreamChunk, StreamPast, StreamPrompt, StreamRow

__all__ = [
    "NewStream",
    "StreamChunk",
    "StreamPast",
    "StreamPrompt",
    "StreamRow",
    "StreamState",
    "abandoned_streams",
    "add_chunk",
    "create_stream",
    "end_stream",
    "get_stream",
    "list_streams",
    "open_streams",
    "prompts_with_rewrites",
    "stream_actions",
    "stream_prompts",
    "take_stream",
]
