"""Small interpreters of the example programs in examples/robots: just what these files use.

Each gives ``send(bytes)`` exactly what the program sends and reads what the program reads; motions
are recorded.
"""

from __future__ import annotations

import re
from collections.abc import Callable

Send = Callable[[bytes], None]
Receive = Callable[[], bytes]


class Halted(Exception):
    """The program stopped because something was not as it should be."""


def run_urscript(text: str, send: Send, receive: Receive) -> list[str]:
    """Motions of the program, with their targets' numbers."""
    values: dict[str, object] = {"socket_open": lambda *_: True}
    moves: list[str] = []
    active = [True]
    for line in (raw.strip() for raw in text.splitlines()):
        if line.startswith("if "):
            active.append(active[-1] and bool(_value(line[3:].removesuffix(":"), values)))
        elif line == "end" and len(active) > 1:
            active.pop()
        elif not active[-1] or line.startswith(("#", "def ", "end")):
            continue
        elif line == "halt":
            raise Halted(text)
        elif sent := re.fullmatch(r'socket_send_line\("([^"]*)", "dlo"\)', line):
            send(sent[1].encode() + b"\n")
        elif read := re.fullmatch(r'(\w+) = socket_read_ascii_float\((\d+), "dlo", \d+\)', line):
            values[read[1]] = _numbers(receive(), int(read[2]))
        elif made := re.fullmatch(r"(\w+) = p\[(.*)\]", line):
            values[made[1]] = [_value(part, values) for part in made[2].split(",")]
        elif line.startswith("movel("):
            moves.append(line)
    return [*moves, repr(values.get("grasp"))]


def _numbers(reply: bytes, count: int) -> list[float]:
    """As socket_read_ascii_float: how many numbers were read, then these."""
    inner = re.fullmatch(r"\((.*)\)\r\n", reply.decode())
    found = [float(part) for part in inner[1].split(",")] if inner else []
    if len(found) < count:
        return [float(len(found)), *found, *([float("nan")] * (count - len(found)))]
    return [float(count), *found[:count]]


def run_rapid(text: str, send: Send, receive: Receive) -> list[str]:
    """Motions of ``main`` in a RAPID program."""
    end = bytes(
        int(code, 16)
        for code in re.findall(r"\\([0-9A-F]{2})", re.search(r'EOL := "(.*)"', text)[1])
    )
    field: list[float] = [0.0] * 17
    moves: list[str] = []
    active = [True]
    body = re.search(r"PROC main\(\)(.*?)ENDPROC", text, re.S)[1]
    for line in (raw.strip() for raw in body.splitlines()):
        if block := re.fullmatch(r"IF (.*) THEN", line):
            active.append(active[-1] and bool(_value(_rapid(block[1]), {"field": field})))
        elif line == "ENDIF":
            active.pop()
        elif active[-1] and (asked := re.fullmatch(r'Ask "(.*)";', line)):
            send(asked[1].encode() + end)
            parts = receive().decode().removesuffix("\r\n").split(",")[1:]
            field[1 : 1 + len(parts)] = [float(part) for part in parts]
        elif active[-1] and (stop := re.fullmatch(r"IF (.*) Stop;", line)):
            if _value(_rapid(stop[1]), {"field": field}):
                raise Halted(line)
        elif active[-1] and line.startswith("MoveL"):
            moves.append(f"{line.split(',')[0]} {field[7:14]}")
    return moves


def _rapid(condition: str) -> str:
    return (
        re.sub(r"field\{(\d+)\}", r"field[\1]", condition)
        .replace("<>", "!=")
        .replace(" = ", " == ")
        .lower()
    )


def run_structured_text(
    text: str, send: Send, receive: Receive, most_steps: int = 50
) -> dict[str, object]:
    """Variables when the program has no step any more."""
    import struct

    plain = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S)
    cases = re.search(r"CASE step OF(.*)END_CASE;", plain, re.S)[1]
    parts = re.split(r"^(\d+):", cases, flags=re.M)[1:]
    steps = {
        int(number): _as_python(body) for number, body in zip(parts[::2], parts[1::2], strict=True)
    }
    tx, rx = bytearray(64), bytearray(512)

    def fill() -> None:
        rx[:] = receive()

    scope: dict[str, object] = {
        "tx": tx,
        "rx": rx,
        "step": 0,
        "SEND": lambda buffer: send(bytes(buffer)),
        "RECEIVE": lambda _: fill(),
        "WORD_OF": lambda high, low: high << 8 | low,
        "REAL_OF": lambda *four: struct.unpack(">f", bytes(four))[0],
    }
    for _ in range(most_steps):
        if scope["step"] not in steps:
            return scope
        exec(steps[scope["step"]], scope)
    raise Halted("too many steps")


def _as_python(body: str) -> str:
    """Statements of structured text; every statement and every keyword on a line of its own,
    indented by its depth."""
    body = re.sub(r"\b(ELSIF|IF)\b(.*?)\bTHEN\b", r"\n\1 \2 THEN\n", body, flags=re.S)
    body = re.sub(r"\b(ELSE|END_IF)\b;?", r"\n\1\n", body).replace(";", "\n")
    lines, depth = [], 0
    for line in filter(None, (raw.strip() for raw in body.splitlines())):
        word = line.split()[0]
        if word in ("ELSIF", "ELSE", "END_IF"):
            depth -= 1
        if word != "END_IF":
            lines.append("    " * depth + _statement(line, word))
        if word in ("IF", "ELSIF", "ELSE"):
            depth += 1
    return "\n".join(lines)


def _statement(line: str, word: str) -> str:
    line = re.sub(r"16#([0-9A-F]+)", r"0x\1", line)
    if word in ("IF", "ELSIF"):
        condition = (
            line.removeprefix(word).removesuffix("THEN").replace(" = ", " == ").replace("<>", "!=")
        )
        return f"{'if' if word == 'IF' else 'elif'} {condition.replace('AND', 'and').strip()}:"
    return "else:" if word == "ELSE" else line.replace(":=", "=")


def _value(expression: str, values: dict[str, object]) -> object:
    return eval(expression.strip(), {"__builtins__": {}}, values)
