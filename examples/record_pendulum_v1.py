# %% [markdown]
# # Learn Gymnasium's `Pendulum-v1` from its episodes, and put the learned model in its place
# Record episodes under random torques, train on them, and score predictions of 1 s on episodes that training never saw.
# Then make an environment of the model, and let the same torques act on both. Needs `symoden[gym]`.

# %%
from pathlib import Path

import gymnasium
import numpy as np

from symoden import Pendulum, TrainingConfig, fit, write_dataset
from symoden.envs import MechanismEnv, random_levels, record
from symoden.evaluation import score_recordings
from symoden.integrate import RK4

data = record(gymnasium.make("Pendulum-v1"), 10, test_episodes=5)
samples = sum(len(recording) for recording in data.train)
print(f"{len(data.train)} episodes with {samples} samples, and {len(data.test)} to test")

# %% [markdown]
# Files of them are what the command line reads: `symoden train runs/pendulum-v1.toml --out runs/pendulum-v1`.

# %%
write_dataset(Path("runs") / "pendulum-v1.toml", data)

# %% [markdown]
# A small budget is enough: the defaults do no better here, since what is left are the steps of the simulation itself.

# %%
budget = TrainingConfig(restarts=1, adam_steps=200, batch_size=128, lm_steps=6, growth_steps=0)
model = fit(data, config=budget).model
scores = score_recordings(model, data, solver=RK4(4), splits=("test",))
errors = [score.window_rmse.median for score in scores if score.window_rmse.median is not None]
print(f"error over 1 s, median: {np.median(errors):.4f} rad")

# %% [markdown]
# The model as an environment. The true pendulum's joints are known, so that pictures need no dial.

# %%
places = Pendulum(upright=True).points
learned = MechanismEnv(model, max_input=2.0, points=places, render_mode="rgb_array")
true = gymnasium.make("Pendulum-v1")
shown, _ = true.reset(seed=1)
angle, rate = np.arctan2(shown[1], shown[0]), shown[2]
predicted, _ = learned.reset(seed=1, options={"q": [angle], "v": [rate]})
policy = random_levels(true.action_space, dt=0.05, seed=1)
for _ in range(20):
    torque = policy(None)
    shown, true_reward, *_ = true.step(torque)
    predicted, reward, *_ = learned.step(torque)
print(f"after 1 s: true {np.round(shown, 3)}, learned {np.round(predicted, 3)} (cos q, sin q, velocity)")
print("the velocities differ because that of Pendulum-v1 is half a step old")
picture = learned.render()
assert isinstance(picture, np.ndarray)
print(f"a picture: {picture.shape}")
