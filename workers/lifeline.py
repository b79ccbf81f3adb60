"""A child process that does not outlive its parent."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1


def die_with_parent(sent: signal.Signals, parent: int) -> None:
    """Have the kernel send us ``sent`` when the thread that started us ends; exit if ``parent`` has
    gone.

    Holds across ``exec``. Elsewhere than on Linux it does nothing: there a child notices by its
    pipe.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, sent.value)
    if os.getppid() != parent:
        sys.exit("the parent is gone")
