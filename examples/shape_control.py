"""Bring a rope into a U: plan, act, look, learn (thesis Algorithm 5), on a simulated table.

Replace ``SimulatedTable`` by a class with the same two methods, ``observe`` and ``execute``, for a
real cell.
"""

from __future__ import annotations

import argparse

from dlo_client import Client, DloObject, ShapeController
from dlo_client.demo.simulated_table import SimulatedTable, target_shape


def main(arguments: list[str] | None = None) -> list[float]:
    """Mean distance to the target in millimeters, before the first action and after each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--actions", type=int, default=8)
    options = parser.parse_args(arguments)
    table = SimulatedTable(length_m=0.45)
    with Client(options.url) as client:
        controller = ShapeController(
            client, table, DloObject(mass_kg=0.05), target_shape("U"), max_actions=options.actions
        )
        outcome = controller.run()
    errors = [1000 * error for error in outcome.errors_m]
    for number, error in enumerate(errors):
        print(f"after {number} actions: {error:.1f} mm from the target")
    print(outcome.reason)
    return errors


if __name__ == "__main__":
    main()
