"""Ariadne+ (thesis section 3.3): paths over a graph of superpixels, two networks at its
intersections."""

from models.instances.published.ariadne_plus.extraction import AriadnePlusParams, extract

__all__ = ["AriadnePlusParams", "extract"]
