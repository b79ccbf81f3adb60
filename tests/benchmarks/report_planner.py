"""Sections of RESULTS.md on the planner."""

from __future__ import annotations

from tests.benchmarks.markdown import table

_TASKS = ("reached", "reached_in_6", "median_final_mm", "median_actions")


_SIMULATORS = {
    "own": "own simulator",
    "mujoco": "MuJoCo",
    "mujoco_hard": "MuJoCo, deep S, M, loop",
    "mujoco_stiff": "MuJoCo, ropes eight times as stiff",
}
_TASK_COLUMNS = [
    "simulator",
    "choice",
    "tasks",
    "reached",
    "in 6 actions",
    "median final mm",
    "median actions",
    "calibration error",
    "processor ms an action",
]


def _task_rows(data: dict) -> list[list]:
    return [
        [
            title,
            choice,
            part["tasks"],
            *(part[key] for key in _TASKS),
            part.get("calibration_error", ""),
            _ms(part),
        ]
        for key, title in _SIMULATORS.items()
        for choice, part in data.get(key, {}).items()
    ]


def _error_rows(data: dict) -> list[list]:
    return [
        [
            title,
            *(
                data[key]["default"]["prediction_mm"][name]
                for name in ("mid_range", "online", "best")
            ),
        ]
        for key, title in _SIMULATORS.items()
        if "prediction_mm" in data.get(key, {}).get("default", {})
    ]


def planner(data: dict) -> str:
    held, par, ms = data["held_out"], data["parameters"], data["times_ms"]
    return (
        "## Planner\n\n`python -m tests.benchmarks.bench_planner`. Network on "
        f"{held['samples']} held-out simulations: {held['error_percent']} % of the mean displacement of "
        f"{held['mean_displacement_mm']} mm (floor 10, aim 4); with mid-range parameters instead of the true ones "
        f"{held['error_percent_mid_range']} %.\n\n"
        f"Parameters of {par['ropes']} random ropes after {par['actions']} random actions, simulated four times as "
        f"finely as the estimator does: k_b within 25 % for {par['k_b_within_25_percent']} % (floor 80, aim 95), "
        f"k_b / k_d for {par['ratio_within_25_percent']} %; stated 90 % intervals cover "
        f"{par['stated_90_percent_covers']} %.\n\n"
        + table(
            ["processor ms, one thread", "median"],
            [[k.replace("_", " "), v] for k, v in ms.items()],
        )
        + "\nFloors: 150 ms an action (aim 40; released code 1100 to 1400), 500 ms a fit (aim 100; 5900 to 7500).\n\n"
        "Tasks U, A, S, I × three ropes × two surfaces, hidden parameters, at most ten actions, reached below 10 mm. "
        "Floors: 90 % in the own simulator, 50 % and a median of at most 10 mm in the independent one; aims 98 % in 6 "
        "actions, 95 % with a median of 7 actions. The bending stiffness of MuJoCo's ropes was chosen once so that "
        "the estimates lie where the thesis found them for real ropes; the stiffer ones are beside them. Processor "
        "time of one thread for all of an action, the estimate from the history included: median and 90 % (floor "
        "150 ms).\n\n"
        + table(_TASK_COLUMNS, _task_rows(data))
        + _held(data.get("held_by_friction", {}), data.get("nearest_held", {}))
        + "\nPrediction error of the next state in mm during the tasks (Fig. 5.8; floor 30 % below mid-range):\n\n"
        + table(["simulator", "mid-range", "online", "best"], _error_rows(data))
    )


def _ms(part: dict) -> str:
    """Median and 90 % of an action's time; empty where nothing is planned or was not measured."""
    return " / ".join(f"{value:.0f}" for value in part["ms"]) if "ms" in part else ""


def _held(held: dict[str, int], near: dict[str, int]) -> str:
    if not held:
        return ""
    of = {
        "mujoco": "24 (U, A, S, I)",
        "mujoco_hard": "18 (deep S, M, loop)",
        "mujoco_stiff": "24 (eight times as stiff)",
    }
    counts = ", ".join(f"{count} of {of[name]}" for name, count in held.items())
    nearest = ", ".join(f"{count} of {of[name]}" for name, count in near.items())
    return (
        f"\nLaid down in the target's very shape and let go, the rope stays within 10 mm in {counts}: friction does "
        "not hold it in the others. "
        + (
            f"Statics find a shape within 10 mm that friction holds at most in {nearest} "
            "(`tests.benchmarks.held_shapes`, friction in all directions as MuJoCo has it along diagonals): no gripper "
            "that lets go reaches more. "
            if near
            else ""
        )
        + "The calibration error is that of the stated probability of at least half of the expected gain (floor 0.10); "
        "how much earlier forecasts count in it was chosen on these tasks.\n"
    )


def obstacles(data: dict) -> str:
    rows = [
        [choice, p["scenes"], p["reached"], p["median_actions"] or "", p["ms"] or ""]
        for choice, p in data.items()
    ]
    return (
        "## Shapes behind pegs\n\n`python -m tests.benchmarks.bench_obstacles`: a U, an S or an A behind one or two "
        "pegs in MuJoCo, which a rope that goes straight to its place would have to pass through; the three ropes, "
        "two surfaces, hidden stiffness and friction, at most 15 actions, reached below 10 mm.\n\n"
        + table(["choice", "scenes", "reached", "median actions", "processor ms an action"], rows)
    )


def hard(data: dict) -> str:
    total = {key: sum(part[key] for part in data.values()) for key in ("tasks", "default", "rule")}
    rows = [
        [
            kind,
            p["tasks"],
            *(f"{p[key]} ({100 * p[key] / p['tasks']:.0f} %)" for key in ("default", "rule")),
        ]
        for kind, p in [*data.items(), ("all", total)]
    ]
    margin = 100 * (total["default"] - total["rule"]) / total["tasks"]
    return (
        "## Hard tasks\n\n`python -m tests.benchmarks.hard_tasks`, from the tables above, all in MuJoCo. "
        f"Margin of the planner over the rule: {margin:.0f} points (floor 25, aim 40).\n\n"
        + table(["tasks", "number", "default", "farthest edge onto its place"], rows)
    )


def fixtures(data: dict) -> str:
    titles = {"pegs": "2 or 3 pegs", "clips": "2 or 3 clips", "mixed": "a peg, a clip and an edge"}
    rows = [
        [
            titles[what],
            choice,
            part["scenes"],
            part["solved"],
            part["median_actions"] or "",
            part["ms"] or "",
        ]
        for what, choices in data.items()
        for choice, part in choices.items()
    ]
    total = [part["default"] for part in data.values()]
    share = sum(p["solved"] for p in total) / sum(p["scenes"] for p in total)
    return (
        "## Ropes around pegs and into clips\n\n`python -m tests.benchmarks.bench_fixtures`: the three ropes in "
        "MuJoCo, straight in any direction at first, dragged, never lifted over a peg, hidden stiffness and friction, "
        "at most 15 actions. Solved: every peg on its side with at most 20 mm of room, every clip filled, in order. "
        "Without a motion none is solved. Floor 70 % of 40 scenes, aim 90 %; "
        f"solved {100 * share:.0f} %.\n\n"
        + table(
            ["scenes", "choice", "number", "solved", "median actions", "processor ms an action"],
            rows,
        )
    )


def dynamics_networks(data: dict) -> str:
    keys = (
        "without_fixed",
        "without_varied",
        "mid_range",
        "parameters_same",
        "parameters_others",
        "true_parameters",
    )
    rows = [
        [
            name,
            e["weights"],
            *(e[key] for key in keys),
            e["ms"]["forward"],
            e["ms"]["forward_backward"],
        ]
        for name, e in data["networks"].items()
    ]
    weights = [
        [
            name,
            *(
                e[k]
                for k in ("parameters_same", "parameters_others", "weights_same", "weights_others")
            ),
        ]
        for name, e in data["networks"].items()
    ]
    header = [
        "network",
        "weights",
        "no params (fixed)",
        "no params (varied)",
        "mid-range",
        "fitted (*)",
        "fitted (**)",
    ]
    return (
        "## Dynamics networks compared (Fig. 5.9, Fig. 5.10)\n\n`python -m models.training.dynamics.compare`: "
        f"{data['minutes']:g} processor minutes of training each; mean prediction error in mm on {data['ropes']} ropes "
        "that none has seen. (*) the same samples for fitting k_b and k_d and for measuring, (**) other ones. Floor: "
        "conditioning 30 % below no parameters.\n\n"
        + table([*header, "true params", "forward ms", "with gradient ms"], rows)
        + "\nFitting the two parameters against fitting all weights:\n\n"
        + table(
            ["network", "parameters (*)", "parameters (**)", "weights (*)", "weights (**)"], weights
        )
    )


SECTIONS = {
    "planner": planner,
    "fixtures": fixtures,
    "obstacles": obstacles,
    "hard": hard,
    "dynamics_networks": dynamics_networks,
}
