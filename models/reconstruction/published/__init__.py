"""The published reconstruction method."""
