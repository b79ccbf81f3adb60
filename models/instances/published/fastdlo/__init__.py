"""FASTDLO (thesis section 3.4): segments of the skeleton, joined by a network that compares their
ends."""

from models.instances.published.fastdlo.extraction import FastDloParams, extract
from models.instances.published.fastdlo.similarity import SimilarityNetwork

__all__ = ["FastDloParams", "SimilarityNetwork", "extract"]
