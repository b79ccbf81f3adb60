"""The published instance methods, each with one signature and one row of
``models.instances.methods``."""

SHARED_RADII = 14.0
"""Longest foreground that two strands of a shallow crossing share: one intersection, not two."""
