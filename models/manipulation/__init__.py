"""State of a DLO on a table and pick-and-place action to its next state (thesis chapter 5).

Symbols: n nodes (16 in the shipped network), B simulations or samples side by side. A state is (n,
2) in meters, an action is (edge, dx, dy, dtheta): the edge between nodes ``edge`` and ``edge + 1``
is gripped, moved by (dx, dy) m in the state's frame and turned by dtheta rad about its middle.
"""
