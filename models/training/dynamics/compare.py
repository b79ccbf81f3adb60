"""Dynamics networks compared as in thesis 5.7.3: ``python -m models.training.dynamics.compare
--varied F --fixed F``.

Every network is trained for the same processor time in three ways: conditioned on the rope's
parameters, without them on the same samples, and without them on samples of one fixed rope. Then
ropes that none has seen are moved in four groups of actions (the thesis's four shapes): k_b and k_d
are fitted on one group and the error is measured on the same group (*) and on the other three (**).
Also Fig. 5.10: fitting all weights instead of the two parameters, and the time of a pass. Finished
trainings and networks are kept, so the command goes on where it was. Writes JSON.
"""

from __future__ import annotations

import argparse
import copy
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from models.manipulation.simulator import Ropes
from models.training.dynamics.data import Samples, generate
from models.training.dynamics.networks import NETWORKS, frame_of, tensors
from models.training.dynamics.train import FAMILY, DynamicsConfig, columns, node_error
from models.training.fit import fit
from models.training.log import Log

MODES = ("conditioned", "without_varied", "without_fixed")
GROUPS, ACTIONS = 4, 6
_MID_RANGE = (0.4737, 0.4074)  # k_b 0.5 and k_d 14, scaled
Columns = tuple[Tensor, ...]


def trained(name: str, mode: str, data: Samples, minutes: float, folder: Path) -> nn.Module:
    """The network, from its state when it was trained to the end before."""
    config = DynamicsConfig(network=name, conditioned=mode == "conditioned", minutes=minutes)
    samples, _ = columns(data, name)
    return fit(
        FAMILY, config, samples, folder / f"{name}_{mode}.pt", Log(folder / f"{name}_{mode}.jsonl")
    )


def groups_of(name: str, ropes: int, seed: int) -> list[list[Columns]]:
    """For every rope, four groups of samples as columns."""
    rng = np.random.default_rng(seed)
    ropes_ = Ropes.random(rng, ropes)
    parts = [generate(rng, ropes, ACTIONS, ropes_) for _ in range(GROUPS)]
    rows = [np.arange(k, ropes * ACTIONS, ropes) for k in range(ropes)]
    return [[tensors(part.taken(own), frame_of(name)) for part in parts] for own in rows]


def error_mm(network: nn.Module, columns: Columns, scaled: Tensor | None) -> float:
    """Mean node error with these scaled k_b and k_d; None leaves the columns as they are."""
    state, edge, move, rope, true = columns
    with torch.inference_mode():
        return 1e3 * float(node_error(network(state, edge, move, _with(rope, scaled)), true).mean())


def _with(rope: Tensor, scaled: Tensor | None) -> Tensor:
    return rope if scaled is None else torch.cat([rope[:, :1], scaled.expand(len(rope), 2)], 1)


def fit_parameters(network: nn.Module, columns: Columns, steps: int = 120) -> Tensor:
    """Scaled k_b and k_d by gradient steps on eq. 5.6, as thesis 5.7.1."""
    state, edge, move, rope, true = columns
    raw = torch.logit(torch.tensor(_MID_RANGE)).requires_grad_()
    optimizer = torch.optim.Adam([raw], lr=0.1)
    for _ in range(steps):
        loss = node_error(network(state, edge, move, _with(rope, torch.sigmoid(raw))), true).sum()
        optimizer.zero_grad()
        torch.autograd.backward(loss, inputs=[raw])
        optimizer.step()
    return torch.sigmoid(raw).detach()


def fit_weights(network: nn.Module, columns: Columns, steps: int = 60) -> nn.Module:
    """All weights adapted to one group, parameters at mid-range (as the RBF approach does
    online)."""
    adapted = copy.deepcopy(network).requires_grad_(True)
    state, edge, move, rope, true = columns
    rope = _with(rope, torch.tensor(_MID_RANGE))
    optimizer = torch.optim.Adam(adapted.parameters(), lr=3e-4)
    for _ in range(steps):
        loss = node_error(adapted(state, edge, move, rope), true).sum()
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
    return adapted


def measure(name: str, networks: dict[str, nn.Module], ropes: int, seed: int) -> dict[str, float]:
    """Mean errors in mm over the ropes; ``same`` is (*), ``others`` is (**)."""
    scores: dict[str, list[float]] = {}

    def note(key: str, value: float) -> None:
        scores.setdefault(key, []).append(value)

    for groups in groups_of(name, ropes, seed):
        for k, group in enumerate(groups):
            rest = [g for j, g in enumerate(groups) if j != k]
            for mode in MODES[1:]:
                note(mode, error_mm(networks[mode], group, None))
            model = networks["conditioned"]
            note("mid_range", error_mm(model, group, torch.tensor(_MID_RANGE)))
            note("true_parameters", error_mm(model, group, None))
            fitted = fit_parameters(model, group)
            note("parameters_same", error_mm(model, group, fitted))
            note("parameters_others", float(np.mean([error_mm(model, g, fitted) for g in rest])))
            adapted = fit_weights(model, group)
            note("weights_same", error_mm(adapted, group, torch.tensor(_MID_RANGE)))
            mid = torch.tensor(_MID_RANGE)
            note("weights_others", float(np.mean([error_mm(adapted, g, mid) for g in rest])))
    return {key: round(float(np.mean(values)), 3) for key, values in scores.items()}


def pass_times_ms(network: nn.Module, name: str, repeats: int = 50) -> dict[str, float]:
    """Processor time of a forward pass, and of one with the gradient of the action, at batch 15."""
    (columns, *_), *_ = groups_of(name, 1, 5)
    state, edge, move, rope, _ = (c[:1].repeat(15, *[1] * (c.ndim - 1)) for c in columns)
    move.requires_grad_()
    taken: dict[str, list[float]] = {"forward": [], "forward_backward": []}
    for _ in range(repeats):
        started = time.process_time()
        network(state, edge, move, rope)
        taken["forward"].append(time.process_time() - started)
        started = time.process_time()
        torch.autograd.backward(network(state, edge, move, rope).sum(), inputs=[move])
        taken["forward_backward"].append(time.process_time() - started)
    return {key: round(1e3 * float(np.median(values)), 3) for key, values in taken.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.dynamics.compare", description=__doc__
    )
    parser.add_argument("--varied", type=Path, required=True, help="samples of random ropes")
    parser.add_argument("--fixed", type=Path, required=True, help="samples of mid-range ropes")
    parser.add_argument(
        "--minutes", type=float, default=2.0, help="processor time of each training"
    )
    parser.add_argument("--ropes", type=int, default=12)
    parser.add_argument("--folder", type=Path, default=Path("checkpoints/compare"))
    parser.add_argument("--out", type=Path, default=Path("build/bench/dynamics_networks.json"))
    args = parser.parse_args()
    torch.set_num_threads(1)
    data = {"varied": Samples.load(args.varied), "fixed": Samples.load(args.fixed)}
    report: dict[str, Any] = {"minutes": args.minutes, "ropes": args.ropes, "networks": {}}
    if args.out.exists():
        kept = json.loads(args.out.read_text())
        report = kept if (kept["minutes"], kept["ropes"]) == (args.minutes, args.ropes) else report
    for name in (n for n in NETWORKS if n not in report["networks"]):
        networks = {
            mode: trained(
                name,
                mode,
                data["fixed" if mode.endswith("fixed") else "varied"],
                args.minutes,
                args.folder,
            )
            for mode in MODES
        }
        size = sum(p.numel() for p in networks["conditioned"].parameters())
        scores = measure(name, networks, args.ropes, seed=909)
        report["networks"][name] = {
            "weights": size,
            **scores,
            "ms": pass_times_ms(networks["conditioned"], name),
        }
        print(name, json.dumps(report["networks"][name]), flush=True)
        args.out.parent.mkdir(parents=True, exist_ok=True)
        args.out.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
