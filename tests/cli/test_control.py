"""What `symoden control` prints and writes."""

import dataclasses
import json
import re
import subprocess
import sys

import jax
import numpy as np
import pytest
from PIL import Image

from symoden.cli import _checks, _control, main
from symoden.cli._control import beyond_data, hardly_moves, pace_words
from symoden.control import METHODS, Compiled, Loop, load_controller
from symoden.evaluation import Ranges
from symoden.experiments import (
    RunConfig,
    learned_machine,
    machine_of,
    read_model,
    read_run,
    read_source,
    summarize,
    write_run,
)
from symoden.known import KnownParts
from symoden.models import build, save
from symoden.spaces import Space
from symoden.training import Ensemble, TrainingConfig
from symoden.training._ensemble import save_ensemble
from symoden.training._flatten import Flattening, cast

from .conftest import SMALL, write_untrained_run

QUICK = ("--episodes", "3", "--duration", "3", "--period", "0.02")


def knowing_run(folder, task, space, **parts):
    """Run of a task whose model knows the truth."""
    data = summarize(read_source(task).dataset)
    write_run(folder, RunConfig(source=task, model=SMALL, training=TrainingConfig(), data=data))
    model = build(SMALL, Space.parse(space), 1, known=KnownParts(**parts), key=jax.random.key(0))
    save(folder / "model.safetensors", model)
    return folder


@pytest.fixture(scope="module")
def near_pendulum(tmp_path_factory):
    parts = {"mass_matrix": [["1/3"]], "potential_energy": "5*cos(q1)", "input_matrix": [[1]]}
    return knowing_run(tmp_path_factory.mktemp("pendulum"), "pendulum", "T1", **parts, dissipation_matrix=[[0.1]])


@pytest.fixture(scope="module")
def learned_slide():
    return build(SMALL, Space.parse("R1"), 1, key=jax.random.key(0))


@pytest.fixture(scope="module")
def near_cart_pole(tmp_path_factory):
    return knowing_run(
        tmp_path_factory.mktemp("cartpole"),
        "cartpole",
        "R1 T1",
        mass_matrix=[[1, "cos(q2)/4"], ["cos(q2)/4", "1/6"]],
        potential_energy="2.45*cos(q2)",
        input_matrix=[[1], [0]],
        dissipation_matrix=[[0, 0], [0, 0.05]],
    )


def test_json_tells_how_the_episodes_went(near_pendulum, tmp_path, capsys):
    figure, video = tmp_path / "control.png", tmp_path / "control.gif"
    words = ["control", str(near_pendulum), *QUICK, "--figure", str(figure), "--video", str(video), "--json"]
    assert main(words) == 0
    answer = json.loads(capsys.readouterr().out.splitlines()[-1], parse_constant=pytest.fail)
    assert list(answer)[:6] == ["env", "method", "episodes", "successes", "median_settling_s", "controller_ms"]
    assert (answer["env"], answer["method"]) == ("symoden/DampedPendulum-v0", "energy-shaping+lqr")
    assert (answer["episodes"], answer["period_s"], answer["max_input"]) == (3, 0.02, [15.0])
    assert answer["largest_input"] <= 15.0
    assert answer["matching"] is None
    assert 0 <= answer["lyapunov"]["share"] <= 1
    assert figure.read_bytes().startswith(b"\x89PNG")
    with Image.open(video) as film:
        assert film.format == "GIF"
        assert getattr(film, "n_frames", 1) > 10


def test_what_was_tried_can_be_kept(near_pendulum, tmp_path, capsys):
    path = tmp_path / "top.safetensors"
    assert main(["control", str(near_pendulum), *QUICK, "--out", str(path)]) == 0
    assert f"controller: {path}" in capsys.readouterr().out
    controller = load_controller(path)
    near, far = Compiled(controller)(np.zeros(1), np.zeros(1)), Compiled(controller)(np.array([3.0]), np.ones(1))
    assert np.abs(near).item() < 1e-9
    assert 0.1 < np.abs(far).item() <= 15.0
    assert main(["control", str(near_pendulum), *QUICK, "--out", str(near_pendulum / "model.safetensors")]) == 2
    assert "must not lie in the run's own folder" in capsys.readouterr().err


def test_people_get_a_table(near_pendulum, capsys):
    assert main(["control", str(near_pendulum), *QUICK, "--noise", "0.01", "--delay", "0.03"]) == 0
    printed = capsys.readouterr()
    assert "energy-shaping+lqr on symoden/DampedPendulum-v0, inputs up to 15, every 20 ms" in printed.out
    for line in (
        "successes",
        "median settling time [s]",
        "one call of the controller [ms]",
        "outside the data",
        "episodes begin with `theta` anywhere at up to 1 rad/s",
    ):
        assert line in printed.out
    assert "3 episodes of 3 s" in printed.err


def test_what_friction_holds_is_told_with_its_number(tmp_path, capsys):
    parts = {"mass_matrix": [[2]], "potential_energy": "0*q1", "input_matrix": [[5]]}
    run = knowing_run(tmp_path, "pendulum", "T1", **parts, dissipation_matrix=[["11/sqrt(v1**2 + 1e-4)"]])
    words = ["control", str(run), "--target", "0.3", "--max-input", "2", *QUICK]
    assert main(words) == 0
    assert "friction holds 3 of 3 episodes beside the target" in (told := capsys.readouterr().out)
    assert "moving takes 2.189" in told
    assert "episodes beside the target; " not in told  # Weight pulls down nothing that might be swung up.
    assert main([*words, "--method", "energy-shaping"]) == 0
    told = capsys.readouterr().out
    assert "energy-shaping leaves 3 of 3 episodes beside the target; `--method energy-shaping+lqr` may not." in told
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["held_by_friction"] == 3


def test_what_a_target_leaves_free_is_none_and_is_named_where_it_helps(near_cart_pole, tmp_path, capsys):
    words = ["control", str(near_cart_pole), "--method", "lqr", "--max-input", "15", *QUICK, "--target"]
    assert main([*words, "-", "0", "--json", "--figure", str(tmp_path / "a.png")]) == 0
    answer = json.loads(capsys.readouterr().out.splitlines()[-1], parse_constant=pytest.fail)
    assert (answer["target"], answer["successes"]) == ([None, 0.0], 3)
    assert main([*words, "0", "0"]) == 0
    assert "need not come to rest anywhere, `--target - 0` may not." in capsys.readouterr().out


def test_ida_pbc_tells_what_remains_unmatched(near_cart_pole, capsys):
    words = ["control", str(near_cart_pole), "--method", "ida-pbc", *QUICK]
    assert main([*words, "--json"]) == 0
    matching = json.loads(capsys.readouterr().out.splitlines()[-1])["matching"]
    assert 0 < matching["rest"] < 1e-3
    assert len(matching["rest_q"]) == len(matching["moving_q"]) == 2
    assert main(words) == 0
    assert "forces that no input matches" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "late"),
    [
        ((), ", 30 ms late, with a lag of 50 ms"),
        (("--delay", "0"), ", with a lag of 50 ms"),
        (("--lag", "0"), ", 30 ms late"),
        (("--delay", "0.01", "--lag", "0.1"), ", 10 ms late, with a lag of 100 ms"),
    ],
)
def test_inputs_act_as_late_as_the_data_set_says(near_pendulum, tmp_path, capsys, words, late):
    config = read_run(near_pendulum)
    write_run(tmp_path, dataclasses.replace(config, data=dataclasses.replace(config.data, delay=0.03, lag=(0.05,))))
    (tmp_path / "model.safetensors").write_bytes((near_pendulum / "model.safetensors").read_bytes())
    assert main(["control", str(tmp_path), *QUICK, *words]) == 0
    assert f"inputs up to 15, every 20 ms{late}\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--method", "magic"], f"must be one of {', '.join(METHODS)}; got 'magic'"),
        (["--env", "Pendulum-v1"], "An environment must be one of symoden/DampedPendulum-v0"),
        (["--env", "symoden/DampedAcrobot-v0"], "The model has the space T1 and 1 inputs"),
        (["--video", "a.mp4"], "`--video` must end in .gif"),
        (["--figure", "a.gif"], "`--figure` must end in one of"),
        (["--out", "a.npz"], "`--out` must end in .safetensors; got `a.npz`"),
        (["--out", "a.safetensors", "--method", "tracking"], "`--out` cannot hold a tracking controller"),
        (["--episodes", "0"], "`--episodes` must be at least 1"),
        (["--max-input", "-1"], "`--max-input` must be positive"),
        (["--max-input", "3", "--method", "energy-shaping"], "must exceed the static load"),
        (["--period", "0"], "`--period` must be positive"),
        (["--delay", "-1"], "`--delay` must be at least 0; got -1"),
        (["--noise", "nan"], "`--noise` must be at least 0; got nan"),
        (["--lag", "0.1", "-1"], "`--lag` must be at least 0; got -1"),
        (["--lag", "0.1", "0.2"], "A lag must be one number or one per input, 1; got 2"),
        (["--lag", "100"], "Delay and lags must be at most 15 s; got 0.0 and (100.0,)"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_does_not_suit_is_one_message(near_pendulum, capsys, words, message):
    assert main(["control", str(near_pendulum), *words]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("error: ")
    assert message in error


def test_what_no_run_makes_right_is_refused_before_jax_is_imported():
    words = ["control", "no-such-run", "--episodes", "0"]
    script = f"import sys; from symoden.cli import main; sys.exit(main({words}) + 7 * ('jax' in sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, "`--episodes` must be at least 1" in done.stderr) == (2, True)


def test_names_that_are_known_before_jax_are_those_of_the_library():
    assert _checks.METHODS == METHODS


@pytest.mark.parametrize(
    ("space", "example"),
    [("T1", "--target 3.14"), ("R1 T1", "--target 0 3.14"), ("R2", "--target 0 0"), (None, "--target")],
)
def test_the_example_of_a_target_has_as_many_numbers_as_there_are_coordinates(space, example):
    with pytest.raises(ValueError, match=re.escape(f"itself: `{example}` [rad, m]")):
        machine_of("/logs/arm.toml", None, space=space)


def test_a_data_set_needs_a_target_or_a_named_machine(arm_run, capsys):
    assert main(["control", str(arm_run)]) == 2
    assert "`--target 3.14` [rad, m], a number for each" in (refusal := capsys.readouterr().err)
    assert "name a simulated machine by `--env`" in refusal


def test_a_controller_is_tried_on_the_learned_model(arm_run, tmp_path, capsys):
    figure = tmp_path / "control.png"
    words = ["control", str(arm_run), "--target", "-1.5", *QUICK, "--figure", str(figure)]
    assert main([*words, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (answer["env"], answer["models"], answer["episodes"]) == ("model", 1, 3)
    assert answer["max_input"] == pytest.approx([1.0], abs=0.01)  # the largest in the logs
    assert figure.exists()
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "on the learned model, inputs up to" in said
    assert "inputs of the data are held for 50 ms: `--period 0.05` tries" in said


def test_a_controller_that_is_faster_than_inputs_were_is_offered_their_pace(arm_run):
    config = read_run(arm_run)
    slow = dataclasses.replace(config.data, step=0.05)
    assert list(pace_words(Loop(period=0.02), slow)) == [
        "inputs of the data are held for 50 ms: `--period 0.05` tries the controller at their pace."
    ]
    assert not list(pace_words(Loop(period=0.02), dataclasses.replace(slow, hold="linear")))
    assert not list(pace_words(Loop(period=0.05), slow))


@pytest.mark.parametrize(("unit", "label"), [("rad", "q [rad]"), ("m", "q [m]"), ("", "q")])
def test_what_a_learned_model_s_coordinates_are_measured_in_is_drawn(described, tmp_path, monkeypatch, unit, label):
    units = f'units = {{ q = "{unit}" }}' if unit else ""
    described.write_text(described.read_text().replace('space = "T1"', f'space = "R1"\n{units}'))
    figures = []
    monkeypatch.setattr(_control, "save_figure", lambda figure, path: figures.append(figure))
    run = write_untrained_run(tmp_path / "run", described)
    assert main(["control", str(run), "--target", "0", *QUICK, "--figure", str(tmp_path / "a.png")]) == 0
    (figure,) = figures
    assert figure.axes[0].get_ylabel() == label


def test_an_ensemble_stands_in_for_the_machine(arm, tmp_path, capsys):
    run = write_untrained_run(tmp_path / "run", arm, members=2)
    restore, theta = Flattening.of(cast(read_model(run), float), corrections=0)
    others = np.asarray(theta) + 0.1 * np.random.default_rng(0).normal(size=(2, theta.size))
    found = Ensemble(restore=restore, theta=np.asarray(theta), windows=9, members=others, tried=2, corrections=0)
    save_ensemble(run / "ensemble.safetensors", found)
    assert main(["control", str(run), "--target", "0.5", *QUICK]) == 0
    assert "on 2 of the ensemble's models" in capsys.readouterr().out


def test_an_input_of_which_the_data_tell_nothing_is_named_where_that_was_found_out(arm, tmp_path, monkeypatch):
    run = write_untrained_run(tmp_path / "run", arm)
    named = []
    monkeypatch.setattr(_control, "posterior_of", lambda *_: "posterior")
    monkeypatch.setattr(_control, "name_untold_inputs", lambda *given: named.append(given[-1]))
    words = ["control", str(run), "--target", "0.5", *QUICK]
    assert main(words) == 0
    assert named == []
    (run / "posterior.safetensors").touch()
    assert main(words) == 0
    assert named == ["posterior"]
    copy = arm.with_name("gone.toml")
    copy.write_text(arm.read_text())
    run = write_untrained_run(tmp_path / "other", copy)
    (run / "posterior.safetensors").touch()
    copy.unlink()  # Without the data nothing is found out.
    assert main(["control", str(run), *words[2:]]) == 0
    assert named == ["posterior"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["--target", "1", "2"],
            "finite number for each of the 1 coordinates of T1, or - where one is free; got 1.0, 2.0",
        ),
        (["--target", "inf"], "one finite number"),
        (["--target", "nan"], "must be finite numbers, or - where a coordinate is free; got nan"),
        (["--target", "-"], "at least one coordinate; all were left free"),
        (["--target", "180"], "got 180 rad, which is 28.6 turns. If degrees were meant, write 3.1416"),
        (["--env", "model"], "needs `--target`"),
        (["--target", "0", "--env", "symoden/DampedPendulum-v0"], "goes to where it is upright"),
        (["--target", "0", "--max-input", "1", "2", "3"], "one number for all 1 inputs or one for each"),
        (["--target", "0", "--video", "a.gif"], "how a learned one looks is not known"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_no_learned_machine_can_do_is_one_message(arm_run, capsys, words, message):
    assert main(["control", str(arm_run), *words]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_a_length_far_from_the_data_is_no_target(learned_slide):
    ranges = Ranges(positions=((-0.56, 0.61),), rates=((-1.0, 1.0),), inputs=((-2.0, 2.0),))
    with pytest.raises(ValueError, match=r"coordinate 1 got 300, far outside \[-0.56, 0.61\]"):
        learned_machine(learned_slide, [300.0], ranges)
    assert learned_machine(learned_slide, [1.5], ranges).max_input == (2.0,)


def test_a_length_that_hardly_moves_is_named():
    assert hardly_moves("x", 0.006).startswith("`x` goes 0.006 in the training data, where 0.05 from the target counts")
    assert not hardly_moves("x", 0.5)


def test_a_target_well_outside_the_data_is_named():
    said = beyond_data("x", 1.2, (-0.5, 0.5), angle=False)
    assert said == "the target 1.2 of `x` is 0.7 outside its training data, -0.5 to 0.5: there the model is a guess."
    assert beyond_data("x", -0.6, (-0.5, 0.5), angle=False).startswith("the target -0.6 of `x` is 0.1 outside")
    assert not beyond_data("x", 0.52, (-0.5, 0.5), angle=False)
    assert not beyond_data("x", 0.1, (-0.5, 0.5), angle=False)


@pytest.mark.parametrize("cyclic", [(), (0,)])
def test_along_what_nothing_depends_on_no_target_is_far(arm, tmp_path, capsys, cyclic):
    run = write_untrained_run(tmp_path / "run", arm)
    config = read_run(run)
    ranges = dataclasses.replace(config.data.ranges, positions=((-0.1, 0.1),), cyclic=cyclic)
    write_run(run, dataclasses.replace(config, data=dataclasses.replace(config.data, ranges=ranges)))
    assert main(["control", str(run), "--target", "0.5", *QUICK]) == 0
    told = capsys.readouterr()
    warned = "warning: the target 0.5 of `q` is 0.4 outside its training data" in told.err
    assert warned == (not cyclic)
    missed = "of the visited states lie outside of the data" in told.out
    assert missed == (not cyclic and not re.search(r"successes +3 of 3", told.out))


@pytest.mark.parametrize("turns", [-2, 0, 1, 300])
def test_of_an_angle_the_shorter_way_to_the_data_counts(turns):
    wound = (2 * np.pi * turns - 1, 2 * np.pi * turns + 2)
    for target, away in ((-1.5, 0.5), (3.0, 1.0), (-2.5, 1.5), (2 * np.pi - 1.5, 0.5)):
        assert f"is {away:g} outside" in beyond_data("q", target, wound, angle=True)
    for target in (-1.1, -0.9, 0.0, 2.1, 2 * np.pi + 1.9, -4.9):
        assert not beyond_data("q", target, wound, angle=True)
    assert not beyond_data("q", 3.0, (-4.0, 4.0), angle=True)


def test_an_angle_may_be_as_many_turns_away_as_the_data_are():
    model = build(SMALL, Space.parse("T1"), 1, key=jax.random.key(0))
    ranges = Ranges(positions=((20.0, 26.0),), rates=((-1.0, 1.0),), inputs=((-2.0, 2.0),))
    for target in (23.0, 31.0, 3.0):
        assert learned_machine(model, [target], ranges).target == (target,)
    with pytest.raises(ValueError, match=r"within a turn of zero or of the training data; coordinate 1 got 180 rad"):
        learned_machine(model, [180.0], ranges)


def test_every_task_has_its_machine():
    for task, inputs in (("pendulum", 1), ("cartpole", 1), ("acrobot", 1), ("cartpole-full", 2), ("acrobot-full", 2)):
        machine = machine_of(task, None)
        assert machine.system.inputs == inputs
        assert len(machine.target) == machine.system.space.size
    assert machine_of("pendulum-canonical", None).target == (np.pi,)
