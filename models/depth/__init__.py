"""A depth map beside the picture: the table, what stands above it, centerlines in meters, the order
at crossings.

Depths are meters along the camera's axis, (H, W) float32 registered to the picture; NaN and 0 are
unknown.
"""
