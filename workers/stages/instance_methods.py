"""The instance method that a request names, with its parameters and the networks it needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import assert_never

import numpy as np
from dlo_client.contracts import AriadnePlusParams, FastDloParams, InstanceMethod, RtDloParams, SectionMatchingParams
from dlo_client.contracts.methods import MethodParams
from numpy.typing import NDArray

from models.instances import section_matching
from models.instances.published import ariadne_plus, fastdlo, rt_dlo
from models.instances.scene import Scene
from models.weights.inference import Network, default_name
from workers.stages.outcome import Tools

Extract = Callable[[NDArray[np.bool_], NDArray[np.uint8] | None], Scene]

_DEFAULTS: dict[InstanceMethod, MethodParams] = {
    "section_matching": SectionMatchingParams(),
    "rt_dlo": RtDloParams(),
    "fastdlo": FastDloParams(),
    "ariadne_plus": AriadnePlusParams(),
}


def extract_with(method: InstanceMethod, params: MethodParams | None, tools: Tools) -> tuple[Extract, list[Network]]:
    """Mask and picture to scene, and the networks that take part. Networks are loaded when first needed."""
    chosen = params or _DEFAULTS[method]
    values = chosen.model_dump(exclude={"method"})
    match chosen:
        case SectionMatchingParams():
            matching = section_matching.SectionMatchingParams(**values)
            return lambda mask, image: section_matching.extract(mask, image, matching), []
        case RtDloParams():
            graph, orientation = rt_dlo.RtDloParams(**values), tools.network(default_name("orientation"))
            return lambda mask, image: rt_dlo.extract(mask, image, graph, orientation), [orientation]
        case FastDloParams():
            merging, similarity = fastdlo.FastDloParams(**values), tools.network(default_name("similarity"))
            return lambda mask, image: fastdlo.extract(mask, image, merging, similarity), [similarity]
        case AriadnePlusParams():
            regions = ariadne_plus.AriadnePlusParams(**values)
            triplet, above = tools.network(default_name("triplet")), tools.network(default_name("above"))
            networks = ariadne_plus.Networks(triplet, above)
            return lambda mask, image: ariadne_plus.extract(mask, image, regions, networks), [triplet, above]
        case _:
            assert_never(chosen)
