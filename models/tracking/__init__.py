"""Cables that keep their identity from one picture to the next.

The menu: :func:`models.tracking.track.follow` takes the track so far and what is seen in a new
frame, and returns the track with every cable's state, certainty and correspondence along its
length.
"""
