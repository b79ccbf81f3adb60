"""An OPC UA server after OPC 40100-1 (machine vision, control). Needs the extra ``opcua``; see
docs/opcua.md."""
