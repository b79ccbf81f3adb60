"""A wire harness against its drawing: which branch is which, what is missing, what should not be
there."""

from __future__ import annotations

import argparse
from pathlib import Path

from dlo_client import Client, DrawnBranch, HarnessDrawing, TopologyRequest, TopologyResult

MASK = Path(__file__).parent.parent / "docs" / "examples" / "harness.png"


def main(arguments: list[str] | None = None) -> TopologyResult:
    """The topology with the match."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--mask", type=Path, default=MASK)
    options = parser.parse_args(arguments)
    with Client(options.url) as client:
        seen = client.run(TopologyRequest(files=[]), mask=options.mask)
        result = client.run(TopologyRequest(drawing=drawing_of(seen), files=[]), mask=options.mask)
    assert result.match is not None
    for branch in result.match.branches:
        print(
            f"{branch.name}: sections {branch.sections}, {branch.length_px:.0f} of {branch.expected_px:.0f} px"
        )
    print(
        f"missing: {', '.join(result.match.missing) or 'nothing'}; extra sections: {result.match.extra or 'none'}"
    )
    return result


def drawing_of(seen: TopologyResult) -> HarnessDrawing:
    """Stands for the drawing that you have: here made of what is seen, its longest branch 10 %
    longer, and one branch more than there is."""
    branches = []
    for section in seen.sections:
        ends = [
            f"P{point}" if point else f"E{section.id}{k}"
            for k, point in enumerate(section.branch_points)
        ]
        branches.append(
            DrawnBranch(name=f"W{section.id}", a=ends[0], b=ends[1], length=section.length_px)
        )
    longest = max(range(len(branches)), key=lambda k: branches[k].length)
    branches[longest] = branches[longest].model_copy(
        update={"length": branches[longest].length * 1.1}
    )
    branches.append(
        DrawnBranch(name="W-absent", a=branches[0].a, b="nowhere", length=branches[0].length * 3)
    )
    return HarnessDrawing(unit="px", branches=branches)


if __name__ == "__main__":
    main()
