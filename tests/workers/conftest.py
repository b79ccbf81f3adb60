"""A connection to the queue server of a test, and the ledger on it."""

from __future__ import annotations

import pytest

from workers.connection import connect
from workers.ledger import Ledger


@pytest.fixture
def client(settings):
    with connect(settings) as client:
        yield client


@pytest.fixture
def ledger(client, settings):
    return Ledger(client, settings)
