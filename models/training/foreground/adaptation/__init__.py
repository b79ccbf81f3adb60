"""A foreground network adapted to one place from a handful of labelled pictures: ``python -m`` this
package.

``sources`` holds what is learnt from, ``course`` learns, ``choice`` decides how much of it is kept.
"""
