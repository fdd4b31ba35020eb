"""What simulate, evaluate, predict and inspect print and write."""

import dataclasses
import json
import re
import shutil
from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest

from symoden.cli import _learned, main
from symoden.evaluation import Prediction
from symoden.experiments import TrainingSummary, read_run, simulate, task, write_run

from .conftest import write_description, write_untrained_run


def answer(capsys, *words):
    """JSON object that a command prints, as the last line and nothing but an object."""
    assert main([*map(str, words), "--json"]) == 0
    return json.loads(capsys.readouterr().out.splitlines()[-1], parse_constant=pytest.fail)


def test_simulate_writes_the_trajectories_of_the_library(tmp_path, capsys):
    path = tmp_path / "data.npz"
    counts = answer(capsys, "simulate", "pendulum", "--out", path, "--seed", 5)["trajectories"]
    assert counts == {"train": 320, "test": 320, "prediction": 64}
    data = simulate(task("pendulum"), seed=5)
    with np.load(path) as file:
        assert (str(file["task"]), str(file["space"]), int(file["seed"])) == ("pendulum", "T1", 5)
        assert file["train_us"].shape == (320, 20, 1)
        assert file["prediction_ts"].shape == (40,)
        np.testing.assert_array_equal(file["test_q"][7], data.dataset.test[7].q)
        np.testing.assert_array_equal(file["prediction_rates"][3], data.prediction[3].rates)


def test_evaluate_gives_the_papers_errors_on_a_task(task_run, capsys):
    scores = answer(capsys, "evaluate", task_run)
    contract = ["task", "model", "parameters", "train_error", "test_error", "prediction_error"]
    assert list(scores) == [*contract, "diverged"]
    assert scores["diverged"] == {"train": 0, "test": 0, "prediction": 0}
    assert (scores["task"], scores["model"]) == ("pendulum", "dissipative")
    for name in ("train_error", "test_error", "prediction_error"):
        assert set(scores[name]) == {"mean", "std"}
        assert scores[name]["mean"] > 0


def test_evaluate_prints_the_papers_errors_beside_its_own(task_run, capsys):
    assert main(["evaluate", str(task_run), "pendulum"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[-3:]] == ["train", "test", "prediction"]
    assert lines[-1].endswith("1.04 ± 1.3")


def test_evaluate_gives_position_errors_on_a_data_set(arm_run, arm, capsys):
    for words in ((arm_run,), (arm_run, arm)):
        recordings = answer(capsys, "evaluate", *words)["recordings"]
        assert [(r["name"], r["split"], r["samples"]) for r in recordings] == [("a", "train", 80), ("b", "test", 60)]
        for recording in recordings:
            errors = {
                "window_rmse",
                "rollout_rmse",
                "astray",
                "coordinates",
                "rollout_coordinates",
                "motion",
                "in_motion",
            }
            assert set(recording) == {"name", "split", "samples", "windows", "diverged"} | errors
            assert set(recording["window_rmse"]) == {"horizon_s", "median", "mean"}
            assert (recording["windows"], recording["diverged"]) == ({"a": 12, "b": 8}[recording["name"]], 0)
            assert recording["coordinates"] == pytest.approx([recording["window_rmse"]["median"]])
            assert recording["window_rmse"]["horizon_s"] == 1.0
            assert 0 < recording["window_rmse"]["median"] < 10


def test_evaluate_prints_a_line_for_every_recording(arm_run, capsys):
    assert main(["evaluate", str(arm_run)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:3] for line in lines[-2:]] == [["a", "train", "80"], ["b", "test", "60"]]


def test_evaluate_says_how_many_positions_its_bands_cover(arm_run, capsys):
    bands = answer(capsys, "evaluate", arm_run, "--bands")["bands"]
    assert (bands["level"], bands["split"]) == (0.9, "test")
    assert 0 <= bands["coverage"] <= 1
    assert bands["half_width"] > 0
    assert bands["half_widths"] == [bands["half_width"]]
    assert bands["coverages"] == pytest.approx([bands["coverage"]])
    assert main(["evaluate", str(arm_run), "--bands"]) == 0
    assert f"cover {bands['coverage']:.1%} of the positions of the test recordings" in capsys.readouterr().out


def test_how_training_went_goes_with_what_came_of_it(arm, tmp_path, capsys):
    outcome, verdict = "stopped at the time limit of 1 minute, with growth still to come", "not kept (for a reason)"
    told = {"friction": verdict}
    trained = TrainingSummary(
        outcome=outcome, completed=False, seconds=61.0, verdicts=told, hardly_judged=("friction",)
    )
    run = write_untrained_run(tmp_path / "run", arm, trained=trained)
    assert answer(capsys, "inspect", run)["training"] == asdict(trained) | {"hardly_judged": ["friction"]}
    assert main(["inspect", str(run)]) == 0
    printed = capsys.readouterr().out
    hardly = "  by very few windows of validation, which hardly tell, training refused friction: longer or more"
    assert f"\ntraining\n  {outcome}, after 61 s\n  friction: {verdict}\n{hardly}" in printed
    page = tmp_path / "page.html"
    assert main(["report", str(run), "--out", str(page)]) == 0
    assert f"Friction: {verdict}." in page.read_text()
    words = ["evaluate", str(run)], ["predict", str(run), str(arm), "--out", str(tmp_path / "paths.npz")]
    for completed in (False, True):
        write_run(run, dataclasses.replace(read_run(run), trained=dataclasses.replace(trained, completed=completed)))
        for each in words:
            capsys.readouterr()
            assert main(each) == 0
            assert (f"not all of training is done: {outcome}" in capsys.readouterr().err) != completed


def test_bands_without_test_recordings_leave_all_other_scores(arm, arm_run, tmp_path, capsys):
    shutil.copytree(arm.parent, tmp_path / "data")
    source = tmp_path / "data" / arm.name
    source.write_text(source.read_text().partition("[test]")[0])
    found = answer(capsys, "evaluate", arm_run, source, "--bands")
    assert len(found["recordings"]) >= 1
    assert found["bands"]["unavailable"].startswith("Bands need recordings in the part `test`")


def test_too_few_windows_give_no_bands_but_all_else(arm_run, arm, tmp_path, capsys):
    run = tmp_path / "run"
    shutil.copytree(arm_run, run)
    config = json.loads((run / "config.json").read_text())
    config["training"] |= {"lm_horizon": 20, "validation": 0.0}
    (run / "config.json").write_text(json.dumps(config))
    message = "Bands need 5 windows of training data or more, to tell how much these disagree; there are 3. "
    found = answer(capsys, "evaluate", run, "--bands")
    assert len(found["recordings"]) == 2
    assert found["bands"]["unavailable"].startswith(message)
    assert main(["evaluate", str(run), "--bands"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith(f"no bands: {message}")
    assert answer(capsys, "inspect", run)["certainty"]["unavailable"].startswith(message)
    assert main(["inspect", str(run)]) == 0
    printed = capsys.readouterr().out
    assert f"no bands: {message}" in printed
    assert " ± " not in printed
    assert main(["report", str(run), "--out", str(tmp_path / "page.html")]) == 0
    assert f"No bands: {message}" in (tmp_path / "page.html").read_text()
    words = ["predict", run, arm, "--out", tmp_path / "paths.npz", "--bands"]
    assert answer(capsys, *words)["bands"]["unavailable"].startswith(message)
    with np.load(tmp_path / "paths.npz") as file:
        assert np.isfinite(file["test:b/q_predicted"]).all()
        for name in ("q_half_width", "q_windows", "q_windows_half_width"):
            assert file[f"test:b/{name}"].shape == (60, 1)
            assert np.isnan(file[f"test:b/{name}"]).all()
    assert main([*map(str, words)]) == 0
    assert f"warning: no bands, so that their arrays are NaN: {message}" in capsys.readouterr().err


def test_predict_writes_every_recording_and_its_rollout(arm_run, arm, tmp_path, capsys):
    path = tmp_path / "paths.npz"
    assert answer(capsys, "predict", arm_run, arm, "--out", path)["recordings"] == 2
    with np.load(path) as file:
        columns = ("ts", "q", "rates", "u", "q_predicted", "rates_predicted")
        assert set(file) == {f"{name}/{column}" for name in ("train:a", "test:b") for column in columns}
        assert file["test:b/q_predicted"].shape == file["test:b/q"].shape == (60, 1)
        np.testing.assert_allclose(file["test:b/q_predicted"][0], file["test:b/q"][0])
        np.testing.assert_allclose(file["test:b/rates_predicted"][0], file["test:b/rates"][0], atol=1e-12)
    assert main(["predict", str(arm_run), str(arm), "--out", str(path)]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "  PART:NAME/{ts,q,rates,u,q_predicted,rates_predicted}, such as train:a/q_predicted"


def test_predict_writes_bands_beside_rollouts(arm_run, arm, tmp_path, capsys):
    path = tmp_path / "paths.npz"
    bands = answer(capsys, "predict", arm_run, arm, "--out", path, "--bands")["bands"]
    assert (bands["level"], bands["horizon_s"], bands["calibrated_on"]) == (0.9, 1.0, "train")
    with np.load(path) as file:
        assert len(file.files) == 2 * 9
        ts, q, whole = (file[f"test:b/{name}"] for name in ("ts", "q", "q_predicted"))
        half, windows, widths = (
            file[f"test:b/{name}"] for name in ("q_half_width", "q_windows", "q_windows_half_width")
        )
    assert half.shape == windows.shape == widths.shape == q.shape == (60, 1)
    assert np.array_equal(np.isfinite(half[:, 0]), ts < 1.0 + 1e-6)
    covered = np.isfinite(widths[:, 0])
    assert np.array_equal(covered, ts < 2.0 + 1e-6)  # Of 2.95 s: the last window is whole, too.
    assert bands["coverage"]["test:b"] == np.mean(np.abs(windows - q)[covered][1:] <= widths[covered][1:])
    np.testing.assert_allclose(windows[:20], whole[:20], atol=1e-6)
    assert main(["predict", str(arm_run), str(arm), "--out", str(path), "--bands"]) == 0
    names, said = capsys.readouterr().out.splitlines()[-2:]
    assert "q_predicted,rates_predicted,q_half_width,q_windows,q_windows_half_width}" in names
    assert said.startswith("90% bands of the first 1 s of q_predicted")


def test_predict_warns_where_the_model_extrapolates(arm_run, described, tmp_path, capsys, monkeypatch):
    def perfect(_model, recordings, **_options):
        return [Prediction(q=r.q, rates=r.rates, observations=r.q) for r in recordings]

    monkeypatch.setattr("symoden.cli._predict.predict", perfect)
    head, *lines = described.with_name("a.csv").read_text().splitlines()
    where = head.split(",").index("v")
    rows = [line.split(",") for line in lines]
    for row in rows[60:]:
        row[where] = str(float(row[where]) + 40)
    described.with_name("b.csv").write_text("\n".join([head, *map(",".join, rows)]) + "\n")
    words = ("predict", str(arm_run), str(described), "--out", str(tmp_path / "paths.npz"))
    assert answer(capsys, *words)["outside"] == {"train:a": 0.0, "test:b": (len(rows) - 60) / len(rows)}
    assert main([*words]) == 0
    printed = capsys.readouterr().err
    assert re.search(
        r"warning: `test:b` lies outside of what training saw for \d+% of its samples, recorded or predicted: "
        r"farthest the velocity of `q`, recorded from -?[\d.]+ to 4[\d.]+, in training from -\S+ to \S+\. There",
        printed,
    )
    assert "`train:a`" not in printed


def test_names_that_occur_in_several_parts_are_told_apart(arm_run, described, tmp_path):
    text = (
        described.read_text()
        .replace('"a.csv"]', '"a.csv"]\nrows = [0, 40]')
        .replace('"b.csv"]', '"a.csv"]\nrows = [40]')
    )
    described.write_text(text)
    assert main(["predict", str(arm_run), str(described), "--out", str(tmp_path / "paths.npz")]) == 0
    with np.load(tmp_path / "paths.npz") as file:
        assert {key.split("/")[0] for key in file} == {"train:a", "test:a"}


def test_inspect_keeps_the_contract(arm_run, capsys):
    found = answer(capsys, "inspect", arm_run)
    assert list(found) == [
        "space",
        "position_units",
        "parameters",
        "anchor",
        "given",
        "identified",
        "mass_matrix_eigenvalues",
        "dissipation_eigenvalues",
        "certainty",
        "audit",
        "training",
    ]
    assert (found["space"], found["position_units"], found["anchor"]) == ("T1", ["rad"], "input_matrix given")
    assert (found["given"], found["identified"]) == ({"input_matrix": "given"}, {})
    assert 0 < found["mass_matrix_eigenvalues"]["min"] <= found["mass_matrix_eigenvalues"]["max"]
    assert set(found["certainty"]["relative"]) == {"M", "V", "g", "D"}
    assert found["certainty"]["relative"]["g"] == 0.0  # given
    assert 0 < found["certainty"]["effective"] <= found["certainty"]["parameters"]
    assert found["audit"]["split"] == "test"
    assert found["audit"]["rollout_violation"] < 1e-6


def test_inspect_shows_the_blocks_over_the_data(arm_run, capsys):
    assert main(["inspect", str(arm_run)]) == 0
    printed = capsys.readouterr().out
    for text in (
        "along q",
        "M[1, 1]",
        "V - min V",
        "D[1, 1]",
        "force D v",
        "power audit",
        "input_matrix",
        " ± ",
    ):
        assert text in printed
    assert "half of a 90% band" in printed
    assert "g[q, u]" not in printed  # It was given.
    assert "anywhere" in printed  # Its friction does not depend on where it is.


@pytest.mark.parametrize(
    ("unit", "rate", "force", "matrices", "errors"),
    [
        ("rad", "rad/s", "N m", ("kg m²", "N m s"), "rad"),
        ("m", "m/s", "N", ("kg", "N s/m"), "m"),
        ("", "", "", ("kg", "N s/m"), "lengths in m, or as they were logged without `units`"),
    ],
    ids=["angle", "length", "as logged"],
)
def test_a_coordinate_on_r_is_shown_in_what_it_is_measured_in(
    described, tmp_path, capsys, unit, rate, force, matrices, errors
):
    units = f'units = {{ q = "{unit}" }}' if unit else ""
    described.write_text(described.read_text().replace('space = "T1"', f'space = "R1"\n{units}'))
    folder = write_untrained_run(tmp_path / "run", described)
    q, v, moved = (f" [{each}]" if each else "" for each in (unit, rate, force))
    M, D = matrices
    assert main(["inspect", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert f"units, where the data are SI and inputs N or N m: M {M}; V J; D {D}\n" in printed
    for head in (rf"q{re.escape(q)} +M\[1, 1\]", rf"v{re.escape(v)} +D\[1, 1\] +force D v{re.escape(moved)}\n"):
        assert re.search(f"^{head}", printed, re.MULTILINE)
    assert main(["evaluate", str(folder)]) == 0
    assert f"position RMSE [{errors}]: over windows of 1 s" in " ".join(capsys.readouterr().out.split())
    learned = _learned.Learned.of(folder)
    assert learned.source is not None
    panels = learned.draw().axes
    assert [ax.get_xlabel() for ax in panels] == [*[f"q{q}"] * 3, f"velocity of q{v}"]
    symbols = [f"M [{M}]", "V - min V [J]", f"D at half of the largest velocities [{D}]", f"friction [{force or 'N'}]"]
    assert [ax.get_title() for ax in panels] == symbols
    drawn = _learned.draw_unseen(learned.model, learned.config, learned.source.dataset, None, ())
    assert drawn.axes[0].get_title() == f"q{q}"


def test_inspect_names_what_was_given_and_what_it_left_open(described, tmp_path, capsys):
    known = '[known]\nmass_matrix = [["m*l**2"]]\nconstants.l = 0.5\nparameters.m = 3\n'
    described.write_text(described.read_text() + known)
    folder = write_untrained_run(tmp_path / "run", described)
    found = answer(capsys, "inspect", folder)
    assert found["given"] == {"mass_matrix": "given up to parameters", "input_matrix": "given"}
    assert found["identified"] == {"m": 3.0}
    assert found["mass_matrix_eigenvalues"] == pytest.approx({"min": 0.75, "max": 0.75})
    assert main(["inspect", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert "mass_matrix: given up to parameters" in printed
    assert "identified parameters\nname" in printed


def test_inspect_says_where_weights_have_a_factor_that_nothing_fixes(described, tmp_path, capsys):
    known = '[known]\nmass_matrix = [["m"]]\nparameters.m = 3\n'
    text = re.sub("^input_matrix.*\n", "", described.read_text(), flags=re.MULTILINE)
    described.write_text(text + known)
    assert main(["inspect", str(write_untrained_run(tmp_path / "run", described))]) == 0
    title = "identified parameters: masses, moments and forces up to one common factor, which `input_matrix` would fix"
    assert f"{title}\nname" in capsys.readouterr().out


def test_inspect_needs_no_data_but_says_that_the_audit_does(arm_run, tmp_path, capsys):
    folder = shutil.copytree(arm_run, tmp_path / "run")
    text = (folder / "config.json").read_text()
    (folder / "config.json").write_text(text.replace("arm.toml", "gone.toml"))
    found = answer(capsys, "inspect", folder)
    assert "gone.toml" in found["audit"]["unavailable"]
    assert "gone.toml" in found["certainty"]["unavailable"]
    assert found["mass_matrix_eigenvalues"] is not None
    assert main(["inspect", str(folder)]) == 0
    assert "not made, because the run's data cannot be read" in capsys.readouterr().out


def test_several_inputs_of_which_nothing_is_told_are_named_at_once(tmp_path, capsys, monkeypatch):
    path = write_description(tmp_path)
    text = path.read_text().replace("input_matrix = [[1]]\n", "").replace('velocities = ["v"]\n', "")
    path.write_text(text.replace('inputs = ["u"]', 'inputs = ["u", "v"]'))
    run = write_untrained_run(tmp_path / "run", path)
    untold = ("g[1, 1]", "g[1, 2]")
    monkeypatch.setattr(_learned, "certainty", lambda *_: SimpleNamespace(undetermined=untold, accelerations={}))
    assert main(["evaluate", str(run), "--bands"]) == 0
    assert capsys.readouterr().err.count("what `u`, `v` do is not told by these data") == 1


@pytest.mark.parametrize(
    ("untold", "accelerations", "named"),
    [
        (("g[1, 1]", "D[1, 1]"), {}, True),
        (("g[1, 1]", "D[1, 1]"), {"inputs": 1.4}, True),
        (("g[1, 1]", "D[1, 1]"), {"inputs": 0.6}, False),  # g is as open as the scale of M.
        (("D[1, 1]",), {}, False),
    ],
)
def test_an_input_of_which_nothing_is_told_is_named(
    described, tmp_path, capsys, monkeypatch, untold, accelerations, named
):
    described.write_text(described.read_text().replace("input_matrix = [[1]]\n", ""))
    run = write_untrained_run(tmp_path / "run", described)
    monkeypatch.setattr(
        _learned, "certainty", lambda *_: SimpleNamespace(undetermined=untold, accelerations=accelerations)
    )
    assert main(["evaluate", str(run), "--bands"]) == 0
    assert ("what `u` does is not told by these data" in capsys.readouterr().err) == named


def test_slow_commands_say_what_they_do(arm_run, capsys, monkeypatch):
    assert main(["inspect", str(arm_run), "--json"]) == 0
    assert capsys.readouterr().err.splitlines() == [
        "how certain the parameters are",
        "bands of M, V, g and D",
        "power audit on the test recordings",
    ]
    assert main(["evaluate", str(arm_run), "--bands", "--json"]) == 0
    poor, *work = capsys.readouterr().err.splitlines()  # Of a model that is not trained.
    assert poor.startswith("warning: over 1 s predictions are off by")
    assert work == ["how certain the parameters are", "bands of predictions"]
    monkeypatch.setenv("FORCE_COLOR", "1")  # As on a terminal.
    assert main(["evaluate", str(arm_run), "--bands", "--json"]) == 0
    printed = capsys.readouterr()
    assert "bands of predictions" in printed.err
    assert "\x1b[" in printed.err
    assert "\x1b[" not in printed.out


def test_a_plain_file_gets_no_escape_codes(arm_run, capsys):
    assert main(["inspect", str(arm_run)]) == 0
    assert "\x1b" not in capsys.readouterr().out
