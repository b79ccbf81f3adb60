"""Labels by the thousand: every picture of a folder, an archive or a list, labelled by the service.

``label_pictures`` does the work and may be killed at any moment: what it has labelled stays, and
the same call goes on. ``formats`` writes the labels for other tools and reads their corrections
back (needs ``dlo-client[label]``).
"""

from dlo_client.labelling.batch import BatchStopped, LabelOptions, label_pictures
from dlo_client.labelling.labels import LabelledInstance, PictureLabel, label_of
from dlo_client.labelling.report import Report
from dlo_client.labelling.sources import SourceError, SourcePicture, find_pictures
from dlo_client.labelling.store import LabelStore, StoreError

__all__ = [
    "BatchStopped",
    "LabelOptions",
    "LabelStore",
    "LabelledInstance",
    "PictureLabel",
    "Report",
    "SourceError",
    "SourcePicture",
    "StoreError",
    "find_pictures",
    "label_of",
    "label_pictures",
]
