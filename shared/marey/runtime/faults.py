"""Classification of faults: retry the items, halve the batch, or end the child."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import TypeVar

import tenacity

from marey.core.errors import MareyError, Unreachable

T = TypeVar("T")

FIRST_PAUSE, LONGEST_PAUSE = 0.2, 2.0  # seconds between retries, doubling with jitter


class HandlerError(MareyError):
    """A fault of the handler: a bug or a broken machine, not known to be caused by the prompt."""

    problem_type = "handler-error"


class OutOfMemory(HandlerError):
    """An item that does not fit into the worker's memory even alone."""

    problem_type = "out-of-memory"


def retry_unreachable(action: Callable[[], T], *, seconds: float, stopping: threading.Event | None = None) -> T:
    """Call `action` until it does not raise `Unreachable`, for at most `seconds`; then raise the last error.

    With `stopping`, a stopping worker makes one more try and gives up.
    """
    give_up = tenacity.stop_after_delay(seconds)
    wait = tenacity.wait_exponential_jitter(multiplier=FIRST_PAUSE, max=LONGEST_PAUSE, jitter=FIRST_PAUSE)
    if stopping is None:
        retrying = tenacity.Retrying(
            retry=tenacity.retry_if_exception_type(Unreachable), stop=give_up, wait=wait, reraise=True
        )
    else:
        retrying = tenacity.Retrying(
            retry=tenacity.retry_if_exception_type(Unreachable),
            stop=tenacity.stop_any(give_up, tenacity.stop_when_event_set(stopping)),
            wait=wait,
            sleep=tenacity.sleep_using_event(stopping),
            reraise=True,
        )
    return retrying(action)


def is_out_of_memory(error: BaseException) -> bool:
    """Return True if a smaller batch may help. Asks torch only if the handler has imported it."""
    if isinstance(error, MemoryError):
        return True
    torch = sys.modules.get("torch")
    if torch is not None and isinstance(error, torch.OutOfMemoryError):
        return True
    # torch's CPU allocator raises a bare RuntimeError.
    return isinstance(error, RuntimeError) and "DefaultCPUAllocator: can't allocate memory" in str(error)


def is_device_lost(error: BaseException) -> bool:
    """Return True if the accelerator's context is gone: every later call in this process fails, so the child must
    end."""
    torch = sys.modules.get("torch")
    accelerator_error = getattr(torch, "AcceleratorError", None)
    return accelerator_error is not None and isinstance(error, accelerator_error)


def as_problem(error: Exception) -> MareyError:
    """Convert an error to the one that the item's owner sees. The text of an unexpected exception stays in the log: it
    may quote the prompt."""
    if isinstance(error, MareyError):
        return error
    if is_out_of_memory(error):
        return OutOfMemory(
            "the worker does not have enough memory for this motion, even alone",
            hint="Request fewer seconds, or run the worker on a machine with more memory.",
        )
    return HandlerError(
        f"the worker failed on this item ({type(error).__name__})",
        hint="It is retried automatically; the worker's log has the details.",
    )
