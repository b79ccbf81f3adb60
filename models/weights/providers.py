"""Where a network runs: the first wanted execution provider of ONNX Runtime that works on this
machine."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import onnxruntime

CPU = "CPUExecutionProvider"
CUDA = "CUDAExecutionProvider"


class ProviderMissingError(RuntimeError):
    """None of the wanted execution providers works here, and the processor is not among them."""


def session(
    data: bytes, options: onnxruntime.SessionOptions, wanted: Sequence[str]
) -> onnxruntime.InferenceSession:
    """The ONNX file ``data``, opened on the providers in ``wanted``, in their order of preference.

    Those that are not installed, or that the machine cannot start, are passed over, which leaves
    the processor if it is wanted too; raises ProviderMissingError if it is not.
    """
    installed = onnxruntime.get_available_providers()
    usable = [name for name in wanted if name in installed]
    if CUDA in usable:
        _load_cuda()
    made = onnxruntime.InferenceSession(data, options, providers=usable or [CPU])
    if not set(made.get_providers()) & set(wanted):
        raise ProviderMissingError(
            f"networks are to run on {', '.join(wanted) or 'no provider'}, which does not work here; this ONNX Runtime "
            f"has {', '.join(installed)}. Name {CPU} last to fall back to the processor"
        )
    return made


@cache
def _load_cuda() -> None:
    """Look for CUDA and cuDNN in the packages beside ONNX Runtime first: no system folder names
    them there."""
    onnxruntime.preload_dlls()
