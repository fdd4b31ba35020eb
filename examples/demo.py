# %% [markdown]
# # Task 2 of the paper: a damped, driven pendulum
# Learn it from the angle and the angular velocity by the default preset, print the errors beside the paper's, and draw
# rollouts and what was learned beside the truth. `make demo` runs this; it takes about a minute and a quarter.

# %%
import itertools
from pathlib import Path

from matplotlib.figure import Figure

from symoden.cli import main
from symoden.experiments import (
    ErrorComparison,
    evaluation_solver,
    holds_run,
    portrait,
    read_model,
    read_run,
    read_run_source,
    score_task,
    unseen_rollouts,
)
from symoden.report import Summary, draw_summary

# %% [markdown]
# The same as on the command line: `symoden train pendulum --out runs/demo`. A demo that was interrupted is resumed; one
# that came to its end is kept, and the next goes into `runs/demo-2`.


# %%
def free_folder() -> Path:
    """First of runs/demo, runs/demo-2, … that holds no finished run and nothing else."""
    names = itertools.chain(["demo"], (f"demo-{n}" for n in itertools.count(2)))
    for folder in (Path("runs") / name for name in names):
        unfinished = holds_run(folder) and not (folder / "model.safetensors").exists()
        if unfinished or not folder.exists():
            return folder
    raise AssertionError("there is always one more name")


folder = free_folder()
status = main(["train", "pendulum", "--out", str(folder), *(["--resume"] if holds_run(folder) else [])])
if status != 0:
    raise SystemExit(status)

# %% [markdown]
# The run holds everything: its settings, its model, and which data it was trained on.

# %%
config, model = read_run(folder), read_model(folder)
source, solver = read_run_source(config), evaluation_solver(config)
assert source.task is not None

errors = ErrorComparison(
    task=source.task.name,
    ours=score_task(model, source, solver=solver),
    paper=source.task.paper[config.model.kind],
)
summary = Summary(
    rollouts=unseen_rollouts(model, source, solver=solver), errors=errors, portrait=portrait(model, source)
)
figure = draw_summary(summary, figure=Figure(figsize=(10, 6), layout="constrained"))
figure.savefig(folder / "demo.png", dpi=110)
print(f"the picture is {folder / 'demo.png'}")
