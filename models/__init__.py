"""What is computed: arrays in, arrays out."""

import os

# ONNX Runtime for Linux reports its use to its maker, from a thread, and keeps an id of the machine
# in the home folder. It looks at this variable when it is first imported, which only modules below
# this package do.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
