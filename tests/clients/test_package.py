"""What importing the package costs and offers."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import dlo_client
import pytest

TYPED = """
from io import BytesIO
from pathlib import Path
from typing import assert_type
import numpy as np
import numpy.typing as npt
from PIL import Image
from dlo_client import *

async def check(client: Client, other: AsyncClient) -> None:
    job = client.submit(InstancesRequest(), images=b"", wait=1)
    assert_type(job, Job[InstancesResult])
    assert_type(client.wait(job, timeout=1), Job[InstancesResult])
    assert_type(result_of(job), InstancesResult)
    assert_type(client.run(SegmentRequest(), "desk.png"), SegmentResult)
    assert_type(client.run_job(SegmentRequest(), "desk.png"), Job[SegmentResult])
    assert_type(client.result(job), InstancesResult)
    assert_type(await other.submit(NoopRequest()), Job[NoopResult])
    assert_type(await other.run(InstancesRequest(), b"", mask=b""), InstancesResult)
    client.run(SegmentRequest(), np.zeros((4, 4, 3), np.uint8), mask=np.zeros((4, 4), bool))
    client.run(SegmentRequest(), [Image.new("L", (4, 4)), Path("desk.png"), open("desk.png", "rb"), BytesIO()])
    for instance in result_of(job).instances:
        assert_type(instance.mask_rle.array(), npt.NDArray[np.bool_])
"""


ROOT = Path(__file__).parents[2]


def _python(*arguments: str) -> subprocess.CompletedProcess[str]:
    root = Path(dlo_client.__file__).parents[1]
    return subprocess.run(
        [sys.executable, *arguments],
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
        cwd=root,
    )


def test_all_that_is_listed_exists() -> None:
    assert [name for name in dlo_client.__all__ if not hasattr(dlo_client, name)] == []
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = dlo_client.nothing


def test_the_package_lists_what_it_offers() -> None:
    """``dir`` showed the contracts only, and not the clients, which load on first use."""
    assert set(dlo_client.__all__) <= set(dir(dlo_client))
    assert {"Client", "AsyncClient", "result_of"} <= set(dir(dlo_client))


def test_the_package_has_a_version() -> None:
    assert dlo_client.__version__[0].isdecimal()


def test_contracts_load_no_http_client() -> None:
    """The workers import the contracts."""
    done = _python("-c", "import sys, dlo_client.contracts; sys.exit('httpx' in sys.modules)")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_sdk_needs_no_command_line_extra() -> None:
    done = _python(
        "-c", "import sys, dlo_client; dlo_client.Client; sys.exit('typer' in sys.modules)"
    )
    assert done.returncode == 0, done.stderr


def test_the_command_without_its_extra_says_what_to_install() -> None:
    program = (
        "import sys; sys.modules['typer'] = None; from dlo_client.commands.cli import main; main()"
    )
    done = _python("-c", program)
    assert done.returncode == 1
    assert 'pip install "dlo-client[cli]"' in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_the_type_of_a_request_gives_that_of_its_result(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    program = tmp_path / "program.py"
    program.write_text(TYPED)
    cache = ["--cache-dir", str(ROOT / "build" / "mypy_of_sdk")]  # kept: without, it takes 6 s
    done = _python("-m", "mypy", "--strict", "--follow-imports=silent", *cache, str(program))
    assert done.returncode == 0, done.stdout + done.stderr
