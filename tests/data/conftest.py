"""Logs of an arm of two joints, their description, and what a check finds in them."""

import numpy as np

from symoden.data import check_dataset

TEXT = """
space = "T2"
time = "t"
positions = ["q1", "q2"]
velocities = ["v1", "v2"]
inputs = ["u1", "u2"]
{more}
[train]
files = [{files}]
"""
NAMES = ("t", "q1", "q2", "v1", "v2", "u1", "u2")


def arm(seed=0, *, samples=2000, step=0.005, quantum=0.0, noise=0.0, amplitude=1.0, jitter=0.3):
    """A log of two joints: smooth motions whose velocities are their derivatives, rounded and noisy."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(step * rng.uniform(1 - jitter, 1 + jitter, samples))
    a, w, c = amplitude * rng.uniform(0.5, 1.0, (2, 2)), rng.uniform(1, 6, (2, 2)), rng.uniform(0, 6, (2, 2))
    phase = w * t[:, None, None] + c
    q, v = (a * np.sin(phase)).sum(axis=2), (a * w * np.cos(phase)).sum(axis=2)
    log = np.concatenate([t[:, None], q, v, np.sin(t[:, None] * [7, 5] + 8 * np.sin(t[:, None] * [2.1, 1.7]))], axis=1)
    log[:, 1:5] += noise * rng.normal(size=(samples, 4))
    return log if not quantum else np.concatenate([log[:, :1], quantum * np.round(log[:, 1:] / quantum)], axis=1)


def written(folder, *logs, more=""):
    names = [f"run{k}.csv" for k in range(len(logs))]
    for name, log in zip(names, logs, strict=True):
        np.savetxt(folder / name, log, delimiter=",", header=",".join(NAMES), comments="", fmt="%.15g")
    path = folder / "arm.toml"
    path.write_text(TEXT.format(more=more, files=", ".join(f'"{name}"' for name in names)))
    return path


def found(path):
    """Findings that are more than facts: (kind, level, channel)."""
    check = check_dataset(path)
    every = [*check.findings, *(finding for each in check.recordings for finding in each.findings)]
    return [(one.kind, one.level, one.channel) for one in every if one.level != "note"]


def scale(log, **factors):
    for name, factor in factors.items():
        log[:, NAMES.index(name)] *= factor
    return log
