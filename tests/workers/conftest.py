"""A connection to the queue server of a test, the ledger on it, and a worker's loaded networks."""

from __future__ import annotations

import pytest

from workers import stages
from workers.connection import connect
from workers.ledger import Ledger
from workers.settings import Settings
from workers.stages.outcome import Tools


@pytest.fixture(scope="session")
def tools(tmp_path_factory) -> Tools:
    """Loaded once, for that takes seconds; a test that changes something puts it back."""
    return stages.warm(Settings(data_dir=tmp_path_factory.mktemp("data"), onnx_threads=1))


@pytest.fixture
def client(settings):
    with connect(settings) as client:
        yield client


@pytest.fixture
def ledger(client, settings):
    return Ledger(client, settings)
