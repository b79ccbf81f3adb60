"""Mask to the topology of branched DLOs (wire harnesses), and the move that disentangles them
(thesis chapter 6)."""
