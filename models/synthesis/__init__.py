"""Labelled pictures of cables from a seed (thesis chapter 2): curves, ribbons, clutter, camera.

Written in torch so that the same code runs on a processor and on a GPU; training-data code only,
the running service never imports it.
"""
