"""CIELAB as OpenCV has it in 8 bits."""

from __future__ import annotations

import numpy as np

LAB_OF_A_LEVEL = np.array([100 / 255, 1.0, 1.0])
"""(3,) what one level of each channel is."""
