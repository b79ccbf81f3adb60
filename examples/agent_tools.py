"""The service as tools of an agent: a server of the Model Context Protocol over standard input and
output.

Register ``python examples/agent_tools.py`` with an agent. Arguments of a tool are checked by the
schema that the service's own OpenAPI document gives; nothing is described twice. JSON-RPC 2.0, one
message a line.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from dlo_client import (
    Client,
    DLOError,
    InstancesRequest,
    PlanShapeRequest,
    TopologyRequest,
    __version__,
)
from pydantic import ValidationError

PROTOCOL = "2025-06-18"
PICTURE = {"type": "object", "required": ["path"], "properties": {"path": {"type": "string"}}}
Tool = Callable[[Client, dict[str, Any]], Any]


def find_cables(client: Client, given: dict[str, Any]) -> Any:
    """Centerline ends, widths and crossings of every cable, wire or rope in a picture."""
    result = client.run(InstancesRequest(points_per_instance=8, files=[]), Path(given["path"]))
    kept = {"id", "score", "centerline_xy", "width_px", "length_px", "endpoints"}
    return {
        "status": result.status.model_dump(mode="json"),
        "cables": [cable.model_dump(mode="json", include=kept) for cable in result.instances],
        "crossings": [crossing.model_dump(mode="json") for crossing in result.crossings],
    }


def read_harness(client: Client, given: dict[str, Any]) -> Any:
    """Branch-points, sections and crossings of a wire harness in a picture."""
    result = client.run(TopologyRequest(files=[]), Path(given["path"]))
    return {
        "message": result.message,
        "sections": [s.model_dump(mode="json", exclude={"points_xy"}) for s in result.sections],
        "crossings": [c.model_dump(mode="json") for c in result.crossings],
    }


def plan_shape(client: Client, given: dict[str, Any]) -> Any:
    """The pick-and-place that brings a rope on a table closest to a target shape; points in
    meters."""
    return client.run(PlanShapeRequest.model_validate(given)).model_dump(
        mode="json", exclude={"alternatives"}
    )


TOOLS: dict[str, tuple[Tool, dict[str, Any]]] = {
    "find_cables": (find_cables, PICTURE),
    "read_harness": (read_harness, PICTURE),
    "plan_shape": (plan_shape, PlanShapeRequest.model_json_schema()),
}


def answer(client: Client, message: dict[str, Any]) -> dict[str, Any] | None:
    """The reply to one message; None to a notification."""
    if "id" not in message:
        return None
    reply = {"jsonrpc": "2.0", "id": message["id"]}
    match message.get("method"):
        case "initialize":
            about = {"name": "dlo-perception", "version": __version__}
            return reply | {
                "result": {
                    "protocolVersion": PROTOCOL,
                    "capabilities": {"tools": {}},
                    "serverInfo": about,
                }
            }
        case "ping":
            return reply | {"result": {}}
        case "tools/list":
            listed = [
                {"name": name, "description": tool.__doc__, "inputSchema": schema}
                for name, (tool, schema) in TOOLS.items()
            ]
            return reply | {"result": {"tools": listed}}
        case "tools/call":
            return reply | {"result": called(client, message.get("params", {}))}
        case other:
            return reply | {"error": {"code": -32601, "message": f"there is no method {other}"}}


def called(client: Client, params: dict[str, Any]) -> dict[str, Any]:
    """A tool's content; an error is content too, so that the agent can mend its arguments."""
    try:
        if params.get("name") not in TOOLS:
            raise ValueError(
                f"there is no tool {params.get('name')!r}; there are: {', '.join(TOOLS)}"
            )
        tool, _ = TOOLS[params["name"]]
        text = json.dumps(tool(client, params.get("arguments", {})))
        return {"content": [{"type": "text", "text": text}], "isError": False}
    except KeyError as error:
        return failed(f"the argument {error} is missing")
    except (DLOError, ValidationError, ValueError, TypeError, OSError) as error:
        return failed(f"{type(error).__name__}: {error}")


def failed(text: str) -> dict[str, Any]:
    return {"content": [{"type": "text", "text": text}], "isError": True}


def serve(client: Client, incoming: TextIO, outgoing: TextIO) -> None:
    """Until the input ends."""
    for line in filter(str.strip, incoming):
        try:
            reply = answer(client, json.loads(line))
        except json.JSONDecodeError as error:
            reply = {
                "jsonrpc": "2.0",
                "id": None,
                "error": {"code": -32700, "message": f"no JSON: {error}"},
            }
        if reply is not None:
            outgoing.write(json.dumps(reply) + "\n")
            outgoing.flush()


def main(
    arguments: list[str] | None = None, incoming: TextIO = sys.stdin, outgoing: TextIO = sys.stdout
) -> None:
    """Serve one agent."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    with Client(parser.parse_args(arguments).url) as client:
        serve(client, incoming, outgoing)


if __name__ == "__main__":
    main()
