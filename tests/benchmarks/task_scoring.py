"""How the tasks of a planner ended, and how well it was known beforehand."""

from __future__ import annotations

import numpy as np

ACTIONS, REACHED_M = 10, 0.01


def summary(rows: list[dict]) -> dict:
    final = np.array([r["errors_mm"][-1] for r in rows])
    used = np.array([len(r["errors_mm"]) - 1 for r in rows])
    done = final <= 1e3 * REACHED_M
    return {
        "tasks": len(rows),
        "reached": int(done.sum()),
        "reached_in_6": int((done & (used <= 6)).sum()),
        "median_final_mm": round(float(np.median(final)), 2),
        "median_best_mm": round(float(np.median([min(r["errors_mm"]) for r in rows])), 2),
        "median_actions": float(np.median(used)),
    }


def stated_and_came(stated: list[tuple[float, float]], rows: list[dict]) -> tuple[float, float]:
    """Means of the stated probability, and of how often half of the expected gain came."""
    errors = np.concatenate([r["errors_mm"][1:] for r in rows]) / 1e3
    probability, half = np.array(stated).T
    return round(float(probability.mean()), 3), round(float((errors <= half).mean()), 3)


def calibration_error(stated: list[tuple[float, float]], rows: list[dict], bins: int = 5) -> float:
    """Mean difference of the stated probability and how often half of the expected gain came, over
    bins of equally many actions."""
    errors = np.concatenate([r["errors_mm"][1:] for r in rows]) / 1e3
    probability, half = np.array(stated).T
    came = errors <= half
    order = np.array_split(np.argsort(probability, kind="stable"), bins)
    off = [len(part) * abs(probability[part].mean() - came[part].mean()) for part in order]
    return round(float(np.sum(off) / len(came)), 3)
