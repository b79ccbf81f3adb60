"""Mask to strands: cleaning, skeleton, graph, sections and their ends, pairing, walks. All methods
stand on it."""
