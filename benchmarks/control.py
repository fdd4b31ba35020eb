"""Controllers made from learned models, tried on the true machines, beside the same made from the truth and others.

    python benchmarks/control.py RUNS [--out runs/control.jsonl] [--only TEXT]

RUNS holds the runs of each task, trained by the default preset: TASK (the dissipative model), symoden-TASK and
naive-TASK. Every finished row is kept, so that an interrupted run goes on where it was. The table is printed in
Markdown: successes of 100 random initial states, and the median settling time [s]. Analytic systems make the rows
`truth`; they are what a learned model is measured against, and nothing learned ever sees them.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import numpy as np

from symoden.control import Loop, Method
from symoden.experiments import ControlConfig, machine_of, outside_data, read_model, read_run, try_control
from symoden.mechanics import AbstractDynamics


@dataclass(frozen=True, kw_only=True)
class Bar:
    """What is to be reached.

    Attributes:
        name: What it is called.
        task: Task that the model was trained on.
        method: How.
        limit: Largest input; the machine's own if None.
        duration: Length of an episode [s].
        least: Successes of 100 that are asked for; 0 if none are.
        naive: Whether a regulator on the naive model's linearisation does the same.
    """

    name: str
    task: str
    method: Method
    limit: float | None = None
    duration: float = 15.0
    least: int = 100
    naive: bool = False


BARS = (
    Bar(name="pendulum, energy shaping", task="pendulum", method="energy-shaping", limit=15.0),
    Bar(name="pendulum, swing-up", task="pendulum", method="swing-up", limit=4.0, least=98),
    Bar(name="pendulum, regulator near the top", task="pendulum", method="lqr", limit=15.0, naive=True),
    Bar(name="cart-pole with two inputs, energy shaping", task="cartpole-full", method="energy-shaping", limit=15.0),
    Bar(name="acrobot with two inputs, energy shaping", task="acrobot-full", method="energy-shaping", limit=40.0),
    Bar(name="pendulum, energy shaping and a regulator", task="pendulum", method="energy-shaping+lqr", limit=15.0),
    Bar(
        name="cart-pole with two inputs, energy shaping and a regulator",
        task="cartpole-full",
        method="energy-shaping+lqr",
        limit=15.0,
    ),
    Bar(
        name="acrobot with two inputs, energy shaping and a regulator",
        task="acrobot-full",
        method="energy-shaping+lqr",
        limit=40.0,
    ),
    Bar(name="cart-pole with two inputs, tracking", task="cartpole-full", method="tracking", limit=60.0),
    Bar(name="acrobot with two inputs, tracking", task="acrobot-full", method="tracking", limit=200.0),
    Bar(name="cart-pole, controlled Lagrangian", task="cartpole", method="controlled-lagrangian", limit=15.0),
    Bar(name="cart-pole, IDA-PBC", task="cartpole", method="ida-pbc", limit=15.0),
    Bar(name="cart-pole, regulator near the top", task="cartpole", method="lqr", limit=15.0, naive=True),
    Bar(name="cart-pole, swing-up", task="cartpole", method="swing-up", limit=15.0, duration=20.0, least=95),
    Bar(name="acrobot, IDA-PBC near the top", task="acrobot", method="ida-pbc", limit=15.0, least=0),
    Bar(name="acrobot, regulator near the top", task="acrobot", method="lqr", limit=15.0, least=0, naive=True),
    Bar(name="acrobot, swing-up", task="acrobot", method="swing-up", limit=15.0, duration=20.0, least=90),
)
LOOPS = {"clean": Loop(period=0.005), "noise, 20 ms": Loop(period=0.02, noise=0.01)}
MODELS = {"learned": "", "truth": None, "undamped": "symoden-", "naive": "naive-"}


def combinations(only: str) -> Iterator[tuple[Bar, str, str]]:
    """Every bar with every model that it applies to, in both loops."""
    chosen = [bar for bar in BARS if only in bar.name]
    yield from ((bar, "learned", loop) for bar in chosen for loop in LOOPS)
    for loop in LOOPS:
        yield from ((bar, "naive", loop) for bar in chosen if bar.naive)
        yield from ((bar, model, loop) for model in ("undamped", "truth") for bar in chosen)


def model_of(runs: Path, task: str, model: str) -> AbstractDynamics | None:
    """The model that the controller is made from; None where it was not trained yet."""
    prefix = MODELS[model]
    if prefix is None:
        return machine_of(task, None).system
    folder = runs / f"{prefix}{task}"
    return read_model(folder) if (folder / "model.safetensors").is_file() else None


def row(runs: Path, bar: Bar, model: str, loop: str) -> dict[str, object] | None:
    """Try one combination."""
    made_from = model_of(runs, bar.task, model)
    if made_from is None:
        return None
    connected = replace(LOOPS[loop], duration=bar.duration)
    config = ControlConfig(method=bar.method, max_input=bar.limit, loop=connected)
    result: dict[str, object] = {"bar": bar.name, "model": model, "loop": loop}
    try:
        tried = try_control(made_from, machine_of(bar.task, None), config)
    except ValueError as error:
        return result | {"error": str(error)}
    verdict = tried.verdict
    result |= {
        "successes": int(verdict.success.sum()),
        "median_settling_s": None if np.isnan(tried.settling) else tried.settling,
        "controller_ms": tried.controller_ms,
        "design_s": tried.design_s,
        "position_error": _quantiles(verdict.position_error),
        "velocity_error": _quantiles(verdict.velocity_error),
        "lyapunov_share": tried.audit.share,
        "lyapunov_worst": tried.audit.worst,
        "lyapunov_worst_q": tried.audit.worst_q,
        "largest_input": float(np.nanmax(np.abs(np.asarray(tried.episodes.u)))),
    }
    if (runs / bar.task / "config.json").is_file():
        result["outside_data"] = outside_data(tried, read_run(runs / bar.task).data.ranges)
    return result


def _quantiles(values: np.ndarray) -> list[float | None]:
    """Median, nine tenths and largest; None where episodes diverged."""
    return [float(x) if np.isfinite(x) else None for x in np.quantile(values, [0.5, 0.9, 1.0])]


def table(rows: dict[str, dict]) -> str:
    """The table in Markdown."""
    names = {
        "learned": "learned",
        "truth": "truth",
        "undamped": "learned without friction",
        "naive": "naive model",
    }
    lines = [
        "| | asked for | " + " | ".join(f"{names[model]} | noise, 20 ms" for model in MODELS) + " | ms |",
        "|---|" + "---:|" * (2 * len(MODELS) + 2),
    ]
    for bar in BARS:
        cells = [_cell(rows.get(_key(bar.name, model, loop))) for model in MODELS for loop in LOOPS]
        mine = rows.get(_key(bar.name, "learned", "clean"), {})
        time = f"{mine['controller_ms']:.3f}" if "controller_ms" in mine else ""
        lines.append(f"| {bar.name} | {bar.least or ''} | {' | '.join(cells)} | {time} |")
    return "\n".join(lines)


def _cell(row: dict | None) -> str:
    """Successes, and the settling time."""
    if row is None:
        return ""
    if "error" in row:
        return "refused"
    settling = row["median_settling_s"]
    return f"{row['successes']}" + ("" if settling is None else f" ({settling:.1f} s)")


def _key(bar: str, model: str, loop: str) -> str:
    """Key of a row."""
    return f"{bar}|{model}|{loop}"


def main() -> None:
    """Run what is not finished, and print the table."""
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    parser = argparse.ArgumentParser(description="Controllers made from learned models, tried on the true machines.")
    parser.add_argument("runs", type=Path)
    parser.add_argument("--out", type=Path, default=Path("runs/control.jsonl"))
    parser.add_argument("--only", default="", help="bars whose names contain this")
    words = parser.parse_args()
    words.out.parent.mkdir(parents=True, exist_ok=True)
    lines = words.out.read_text().splitlines() if words.out.is_file() else []
    rows = {_key(r["bar"], r["model"], r["loop"]): r for r in map(json.loads, lines)}
    for bar, model, loop in combinations(words.only):
        if _key(bar.name, model, loop) in rows:
            continue
        found = row(words.runs, bar, model, loop)
        jax.clear_caches()  # Every compiled program holds memory maps, of which a process may have 65530.
        if found is None:
            continue
        rows[_key(bar.name, model, loop)] = found
        with words.out.open("a") as file:
            file.write(json.dumps(found) + "\n")
        print(f"{bar.name}, {model}, {loop}: {_cell(found)} {found.get('error', '')}", flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
