"""Where networks run; a machine with a GPU is played by an ONNX Runtime that claims to have one."""

from __future__ import annotations

from types import SimpleNamespace

import onnxruntime
import pytest

from models.weights import inference, providers
from models.weights.inference import Runtime
from models.weights.providers import CPU, CUDA, ProviderMissingError

SMALL = "ariadne_plus_triplet"


@pytest.fixture
def machine(monkeypatch):
    """``machine(installed, works)``: what sessions are then opened with, and how often CUDA was
    looked for."""

    def pretend(installed: list[str], works: list[str]) -> tuple[list[list[str]], list[None]]:
        asked: list[list[str]] = []
        loads: list[None] = []

        def opened(_data, _options, providers):
            asked.append(providers)
            return SimpleNamespace(
                get_providers=lambda: [*(p for p in providers if p in works and p != CPU), CPU]
            )

        providers._load_cuda.cache_clear()
        monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: installed)
        monkeypatch.setattr(onnxruntime, "InferenceSession", opened)
        monkeypatch.setattr(onnxruntime, "preload_dlls", lambda: loads.append(None))
        return asked, loads

    yield pretend
    providers._load_cuda.cache_clear()


def opened_on(wanted):
    return providers.session(b"", None, wanted).get_providers()


def test_the_gpu_is_used_first_where_there_is_one(machine):
    asked, loads = machine([CUDA, CPU], works=[CUDA])
    assert [opened_on([CUDA, CPU]) for _ in range(2)] == [[CUDA, CPU]] * 2
    assert asked == [[CUDA, CPU]] * 2
    assert len(loads) == 1, "CUDA of the packages is loaded once, before the first session"


def test_the_order_is_the_preference(machine):
    asked, loads = machine([CUDA, CPU], works=[CUDA])
    opened_on([CPU])
    assert (asked, loads) == ([[CPU]], [])
    opened_on([CPU, CUDA])
    assert asked[-1] == [CPU, CUDA]


@pytest.mark.parametrize("installed", [[CPU], [CUDA, CPU]], ids=["not installed", "without a GPU"])
def test_the_processor_stands_in_where_it_is_named(machine, installed):
    machine(installed, works=[])
    assert opened_on([CUDA, CPU]) == [CPU]


@pytest.mark.parametrize("installed", [[CPU], [CUDA, CPU]], ids=["not installed", "without a GPU"])
def test_whoever_wants_a_gpu_alone_is_not_given_the_processor(machine, installed):
    """A worker that was to use a GPU ran on the processor, ten times slower, and nothing said
    so."""
    machine(installed, works=[])
    with pytest.raises(
        ProviderMissingError, match=f"on {CUDA}, which does not work here.*Name {CPU} last"
    ):
        opened_on([CUDA])


def test_a_misspelt_provider_is_named(machine):
    machine([CUDA, CPU], works=[CUDA])
    with pytest.raises(ProviderMissingError, match="CudaExecutionProvider"):
        opened_on(["CudaExecutionProvider"])


def test_the_real_runtime_falls_back_or_refuses():
    network = inference.load(SMALL, Runtime([CUDA, CPU], 1))
    assert network.provider == (CUDA if CUDA in onnxruntime.get_available_providers() else CPU)
    with pytest.raises(ProviderMissingError, match="NoSuchProvider"):
        inference.load(SMALL, Runtime(["NoSuchProvider"], 1))
