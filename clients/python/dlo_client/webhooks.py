"""For the receiver of a webhook: is this body from our service, and fresh?"""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
import time
from collections.abc import Mapping

from pydantic import TypeAdapter, ValidationError

from dlo_client.contracts import AnyJob
from dlo_client.errors import UnexpectedReply

_JOB: TypeAdapter[AnyJob] = TypeAdapter(AnyJob)
_HEADERS = ("webhook-id", "webhook-timestamp", "webhook-signature")
_SECRET_PREFIX = "whsec_"


def read_webhook(
    body: bytes, headers: Mapping[str, str], secret: str, *, tolerance_s: float = 300.0
) -> AnyJob:
    """The ended job of a webhook call, from its ``body`` and its ``headers`` (of Standard
    Webhooks).

    Delivery is at least once: remember ``job.id``, which also is ``webhook-id``, to tell repeats.

    Raises: UnexpectedReply: the signature is not of this secret and body, is older than
        ``tolerance_s``, or the
            body is no job.
    """
    given = {name.lower(): value for name, value in headers.items()}
    if missing := [name for name in _HEADERS if not given.get(name)]:
        raise UnexpectedReply(f"the webhook has no {', '.join(missing)}")
    message_id, timestamp, signatures = (given[name] for name in _HEADERS)
    if not re.fullmatch(r"\d{1,12}", timestamp, re.ASCII):
        raise UnexpectedReply("the webhook's timestamp is none")
    digest = hmac.new(
        _key(secret), f"{message_id}.{timestamp}.".encode() + body, hashlib.sha256
    ).digest()
    expected = f"v1,{base64.b64encode(digest).decode()}".encode()
    # Several may be given while a secret is exchanged.
    if not any(hmac.compare_digest(expected, one.encode()) for one in signatures.split()):
        raise UnexpectedReply("the webhook's signature is not of this secret and body")
    if abs(time.time() - int(timestamp)) > tolerance_s:
        raise UnexpectedReply("the webhook's signature is too old")
    try:
        return _JOB.validate_json(body)
    except ValidationError as error:
        raise UnexpectedReply(f"the webhook's body is no job: {error}") from error


def _key(secret: str) -> bytes:
    """A secret as the standard writes it is base64 after a prefix; any other is taken as it
    stands."""
    if secret.startswith(_SECRET_PREFIX):
        return base64.b64decode(secret.removeprefix(_SECRET_PREFIX))
    return secret.encode()
