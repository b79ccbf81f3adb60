"""What pictures show of strands, whatever reads it."""

from __future__ import annotations

NOISE_LEVELS = 4.0
"""Standard deviation of a color along one strand that means nothing, in gray levels."""
LEAST_SINE = 0.3
"""Of the angle between two strands: at a flatter one they lie on one another for longer, but not
that much."""
SHARED_RADII = 16.0
"""The longest foreground, in radii, that two strands of a shallow crossing share."""
