"""Answers about tracks as the service gives them."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
from dlo_client.contracts import (
    CableCrossing,
    CablePosition,
    Endpoint,
    FrameResult,
    TrackedCable,
    TrackInfo,
    TrackOptions,
    TrackState,
)
from dlo_client.contracts.tracking import NODES, CableState

TRACK_ID = "5" * 32


def info() -> TrackInfo:
    now = datetime(2026, 1, 1, tzinfo=UTC)
    return TrackInfo(
        id=TRACK_ID, options=TrackOptions(), frames=0, cables=0, created_at=now, expires_at=now
    )


def frame(
    number: int = 1, states: tuple[CableState, ...] = ("seen", "partly_covered", "lost")
) -> FrameResult:
    """Horizontal cables, 20 px apart; of one that is partly covered the last third is."""
    return FrameResult(
        frame=number,
        width=160,
        height=120,
        cables=[_cable(k, state) for k, state in enumerate(states, start=1)],
        crossings=[
            CableCrossing(
                xy=(80.0, 20.0),
                over=CablePosition(cable=1, u=0.5),
                under=CablePosition(cable=2, u=0.5),
                score=0.9,
            )
        ],
        track=TrackState(frame=number, next_id=len(states) + 1),
    )


def _cable(number: int, state: CableState) -> TrackedCable:
    points = [(float(x), 20.0 * number) for x in np.linspace(10, 150, NODES)]
    return TrackedCable(
        id=number,
        state=state,
        certainty=0.9,
        instance=None if state == "lost" else number,
        centerline_xy=points,
        length_px=140.0,
        width_px=6.0,
        start_px=0.0,
        covered={"partly_covered": [(0.67, 1.0)], "lost": [(0.0, 1.0)]}.get(state, []),
        endpoints=[Endpoint(xy=points[0], kind="free"), Endpoint(xy=points[-1], kind="free")],
        score=0.95,
    )
