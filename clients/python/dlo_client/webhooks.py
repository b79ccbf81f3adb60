"""For the receiver of a webhook: is this body from our service, and fresh?"""

from __future__ import annotations

import hashlib
import hmac
import re
import time

from pydantic import TypeAdapter, ValidationError

from dlo_client.contracts import AnyJob
from dlo_client.errors import UnexpectedReply

_JOB: TypeAdapter[AnyJob] = TypeAdapter(AnyJob)


def read_webhook(body: bytes, signature: str, secret: str, *, tolerance_s: float = 300.0) -> AnyJob:
    """The ended job of a webhook call: its ``body`` and its header ``DLO-Signature``.

    Delivery is at least once: remember ``job.id`` to tell repeats.

    Raises:
        UnexpectedReply: the signature is not of this secret and body, is older than ``tolerance_s``, or the
            body is no job.
    """
    parts = re.fullmatch(r"t=(\d{1,12}),v1=([0-9a-f]{64})", signature)
    if not parts:
        raise UnexpectedReply("the webhook has no DLO-Signature of the form t=…,v1=…")
    expected = hmac.new(secret.encode(), parts[1].encode() + b"." + body, hashlib.sha256).hexdigest()
    if not hmac.compare_digest(expected, parts[2]):
        raise UnexpectedReply("the webhook's signature is not of this secret and body")
    if abs(time.time() - int(parts[1])) > tolerance_s:
        raise UnexpectedReply("the webhook's signature is too old")
    try:
        return _JOB.validate_json(body)
    except ValidationError as error:
        raise UnexpectedReply(f"the webhook's body is no job: {error}") from error
