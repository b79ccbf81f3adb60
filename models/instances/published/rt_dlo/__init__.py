"""RT-DLO (thesis section 3.5): a graph of sampled vertices over the foreground, cut into one path a
DLO."""

from models.instances.published.rt_dlo.extraction import RtDloParams, extract
from models.instances.published.rt_dlo.orientation import OrientationNetwork

__all__ = ["OrientationNetwork", "RtDloParams", "extract"]
