"""CVAT's serverless function: a picture in, masks and centerlines out. See function.yaml.

Copy `clients/python/dlo_client` beside this file before it is deployed.
"""

from __future__ import annotations

import base64
import json
from typing import Any

from dlo_client import Client, DLOError, InstancesRequest
from dlo_client.contracts import Instance


def init_context(context: Any) -> None:
    """Called once by nuclio; the client reads DLO_URL and DLO_API_KEY."""
    context.user_data.client = Client()


def handler(context: Any, event: Any) -> Any:
    """CVAT sends ``{"image": base64, "threshold"?: 0 to 1}`` and takes a list of shapes.

    ``threshold`` is CVAT's: instances with a lower score are left out.
    """
    try:
        body = json.loads(event.body) if isinstance(event.body, str | bytes) else event.body
        picture = base64.b64decode(body["image"])
        least = float(body.get("threshold") or 0.0)
    except (KeyError, TypeError, ValueError) as error:
        return _response(context, {"error": f"no picture: {error}"}, 400)
    try:
        result = context.user_data.client.run(InstancesRequest(files=[]), picture)
    except DLOError as error:
        return _response(context, {"error": str(error)}, 502)
    shapes = [shape for one in result.instances if one.score >= least for shape in shapes_of(one)]
    return _response(context, shapes, 200)


def shapes_of(instance: Instance) -> list[dict[str, Any]]:
    """A mask in CVAT's form (0 and 1 within the box, then the box), and the centerline."""
    import numpy as np

    common = {"confidence": str(instance.score), "group_id": instance.id}
    shapes: list[dict[str, Any]] = []
    mask = instance.mask_rle.array()
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if rows.size:
        top, bottom, left, right = (int(v) for v in (rows[0], rows[-1], columns[0], columns[-1]))
        inside = mask[top : bottom + 1, left : right + 1].astype(int).ravel().tolist()
        shapes.append(
            common | {"label": "dlo", "type": "mask", "mask": [*inside, left, top, right, bottom]}
        )
    points = [float(value) + 0.5 for xy in instance.centerline_xy for value in xy]
    shapes.append(common | {"label": "centerline", "type": "polyline", "points": points})
    return shapes


def _response(context: Any, content: Any, status: int) -> Any:
    return context.Response(
        body=json.dumps(content), headers={}, content_type="application/json", status_code=status
    )
