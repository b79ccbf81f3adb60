"""The protocol of text lines: ASCII, fields apart by commas, each line ended by CR LF (LF alone is
read too).

=================================  =========================================================================
line of the controller             reply
=================================  =========================================================================
``P,seq[,x,y,z,r1,r2,r3[,r4]]``    ``P,seq,status``: a picture more for this number, from this flange
``T,seq,recipe[,x,…,r3[,r4]]``     ``T,seq,status``: trigger; 1 is accepted
``R,seq[,wait_ms]``                ``R,seq,status,poses,recipe,version,time_ms``: result; 2 is still running
``G,seq,n``                        ``G,seq,status,n,role,id,score,x,y,z,r1,r2,r3[,r4]``: the n-th pose, from 1
``X,seq``                          ``X,seq,status``: cancel
``H,n``                            ``H,n,0,busy,waiting,done,failed``: heartbeat
``V,n``                            ``V,n,0,major,minor,patch``
=================================  =========================================================================

``role``: 1 first, 2 middle, 3 last, 4 hold, 5 pick, 6 place. Numbers of poses are in the recipe's
unit and convention. With ``reply = "parentheses"`` a reply is ``(seq,status,…)``: numbers alone, as
``socket_read_ascii_float`` reads them.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Sequence

from dlo_client.bridge.cell import LARGEST_SEQUENCE, Cell
from dlo_client.bridge.status import Status
from dlo_client.contracts.frames import RobotPose
from dlo_client.version import __version__

LONGEST_LINE = 256
ROLES = {"first": 1, "middle": 2, "last": 3, "hold": 4, "pick": 5, "place": 6}
_Numbers = Sequence[float]


class TextLines:
    """Replies to lines; ``parentheses``: numbers alone."""

    def __init__(self, cell: Cell, parentheses: bool) -> None:
        self._cell = cell
        self._parentheses = parentheses
        self._commands: dict[str, Callable[[list[str]], Awaitable[list[float]]]] = {
            "P": self._picture,
            "T": self._trigger,
            "R": self._result,
            "G": self._pose,
            "X": self._cancel,
            "H": self._heartbeat,
            "V": self._version,
        }

    async def reply(self, line: str) -> bytes:
        """The reply to one line, without its end."""
        name, *fields = [field.strip() for field in line.split(",")]
        name = name.upper()
        command = self._commands.get(name)
        if command is None:
            return self._written("E", [0, Status.UNKNOWN_COMMAND])
        try:
            return self._written(name, await command(fields))
        except (ValueError, IndexError, OverflowError):
            return self._written(name, [_sequence(fields, quiet=True), Status.BAD_ARGUMENT])

    def _written(self, name: str, numbers: _Numbers) -> bytes:
        text = ",".join(_number(number) for number in numbers)
        return (f"({text})" if self._parentheses else f"{name},{text}").encode("ascii") + b"\r\n"

    async def _picture(self, fields: list[str]) -> list[float]:
        sequence = _sequence(fields)
        return [sequence, await self._cell.picture(sequence, _flange(fields[1:]))]

    async def _trigger(self, fields: list[str]) -> list[float]:
        sequence, recipe = _sequence(fields), _whole(fields[1], 65_535)
        return [sequence, await self._cell.trigger(sequence, recipe, _flange(fields[2:]))]

    async def _result(self, fields: list[str]) -> list[float]:
        sequence = _sequence(fields)
        wait_s = _whole(fields[1], 60_000) / 1000 if len(fields) > 1 else None
        found = await self._cell.result(sequence, wait_s)
        return [
            sequence,
            found.status,
            len(found.poses),
            found.recipe,
            found.version,
            found.time_ms,
        ]

    async def _pose(self, fields: list[str]) -> list[float]:
        sequence, number = _sequence(fields), _whole(fields[1], 65_535)
        found = await self._cell.result(sequence, 0.0)
        if not 1 <= number <= len(found.poses):
            wrong = (
                found.status
                if found.status in (Status.RUNNING, Status.UNKNOWN_SEQUENCE)
                else Status.NO_SUCH_POSE
            )
            return [sequence, wrong]
        return [sequence, found.status, number, *pose_numbers(found.poses[number - 1])]

    async def _cancel(self, fields: list[str]) -> list[float]:
        sequence = _sequence(fields)
        return [sequence, self._cell.cancel(sequence)]

    async def _heartbeat(self, fields: list[str]) -> list[float]:
        state = self._cell.state()
        return [_sequence(fields), Status.OK, state.busy, state.waiting, state.done, state.failed]

    async def _version(self, fields: list[str]) -> list[float]:
        return [_sequence(fields), Status.OK, *(int(part) for part in __version__.split(".")[:3])]


def pose_numbers(pose: RobotPose) -> list[float]:
    """Role, id, score, position, rotation."""
    return [ROLES[pose.role], pose.id, pose.score, *pose.position, *pose.rotation]


def _sequence(fields: list[str], *, quiet: bool = False) -> int:
    """The first field; raises ValueError, or is 0 where ``quiet``."""
    try:
        return _whole(fields[0], LARGEST_SEQUENCE)
    except (ValueError, IndexError):
        if quiet:
            return 0
        raise


def _whole(text: str, largest: int) -> int:
    number = int(text)
    if not 0 <= number <= largest:
        raise ValueError(f"{text} is not from 0 to {largest}")
    return number


def _flange(fields: list[str]) -> list[float]:
    """None, or 6 or 7 finite numbers; raises ValueError."""
    numbers = [float(field) for field in fields]
    if len(numbers) not in (0, 6, 7) or not all(math.isfinite(number) for number in numbers):
        raise ValueError("a pose has 6 or 7 numbers")
    return numbers


def _number(number: float) -> str:
    """As short as it is exact to 6 places; never in powers of ten, which controllers do not
    read."""
    if isinstance(number, int):
        return str(int(number))
    return f"{number:.6f}".rstrip("0").rstrip(".") if number else "0"
