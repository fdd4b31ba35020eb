"""Bad input, each once through the command line: status 2, one line that says what is wrong, nothing lost."""

import errno
import os
import shutil

import h5py
import numpy as np
import pytest

from symoden.cli import main


def refused(capsys, *words, status=2):
    """The message of a command that fails."""
    assert main([*map(str, words)]) == status
    printed = capsys.readouterr()
    lines = [line for line in printed.err.splitlines() if not line.startswith("training a ")]
    assert len(lines) == 1, printed.err
    assert lines[0].startswith("error: ")
    return lines[0]


def rewrite(path, change):
    lines = path.read_text().splitlines()
    change(lines)
    path.write_text("\n".join(lines) + "\n")


def cell(row, column, text):
    def change(lines):
        cells = lines[row + 1].split(",")
        cells[column] = text
        lines[row + 1] = ",".join(cells)

    return change


BAD_FILES = {
    "missing column": (lambda lines: lines.__setitem__(0, "t,q,w,u"), ["a.csv", "no column `v`"]),
    "text in a number column": (cell(5, 2, "fast"), ["a.csv", "`v`", "row 5", "fast"]),
    "no number in a column": (
        lambda lines: [cell(row, 1, "nan")(lines) for row in range(80)],
        ["a.csv", "`q` lacks 80"],
    ),
    "time that goes back": (cell(9, 0, "0.1"), ["a.csv", "row 9", "must increase"]),
    "recording shorter than a window": (lambda lines: lines.__delitem__(slice(3, None)), ["a"]),
    "empty file": (lambda lines: lines.clear(), ["a.csv"]),
}


@pytest.mark.parametrize("bad", BAD_FILES)
def test_bad_recordings(described, tmp_path, capsys, bad):
    change, words = BAD_FILES[bad]
    rewrite(described.parent / "a.csv", change)
    message = refused(capsys, "train", described, "--out", tmp_path / "run")
    assert [word for word in words if word not in message] == []
    assert not (tmp_path / "run").exists()


BAD_DESCRIPTIONS = {
    "wrong space": ('"T1"', '"R1 T1"', "2"),
    "no space": ('"T1"', '"Q1"', "'Q1'"),
    "unknown key": ("inputs", "input", "inputs"),
    "wrong input matrix": ("[[1]]", "[[1, 0]]", "input_matrix"),
    "no such file": ("a.csv", "z.csv", "z.csv"),
    "no toml": ('space = "T1"', "space", "TOML"),
}


@pytest.mark.parametrize("bad", BAD_DESCRIPTIONS)
def test_bad_descriptions(described, tmp_path, capsys, bad):
    old, new, word = BAD_DESCRIPTIONS[bad]
    described.write_text(described.read_text().replace(old, new))
    assert word in refused(capsys, "train", described, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_wrong_options(described, tmp_path, capsys):
    run = ("--out", tmp_path / "run")
    assert "R2" in refused(capsys, "train", described, *run, "--space", "R2")
    assert "magic" in refused(capsys, "train", described, *run, "--model", "magic")
    assert "fast" in refused(capsys, "train", described, *run, "--preset", "fast")
    assert "-1" in refused(capsys, "train", described, *run, "--seed", "-1")
    assert "--max-minutes" in refused(capsys, "train", described, *run, "--max-minutes", "0")
    assert "must be a task (pendulum-canonical" in refused(capsys, "train", "pendulm", *run)
    for name in ("gone.toml", tmp_path / "gone"):
        assert f"`{name}`: must be the file of a data set" in (said := refused(capsys, "train", name, *run))
        assert "there is no such file. Correct the path." in said
    assert "there is a folder" in refused(capsys, "train", tmp_path, *run)
    for option, word in (("--trajectories", "4"), ("--noise", "0.1")):
        assert "for tasks only" in refused(capsys, "train", described, *run, option, word)
    assert "at least 1; got 0" in refused(capsys, "train", "pendulum", *run, "--trajectories", "0")
    assert "at least 0 and finite; got -0.1" in refused(capsys, "train", "pendulum", *run, "--noise", "-0.1")
    assert "must be one of pendulum-canonical" in refused(capsys, "simulate", "pendulm", "--out", tmp_path / "a.npz")
    for command in ("simulate", "pendulum"), ("predict", tmp_path / "run", "pendulum"):
        assert "`--out` must end in .npz; got" in refused(capsys, *command, "--out", tmp_path / "a.csv")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("resume", [(), ("--resume",)])
def test_a_new_run_needs_a_source(tmp_path, capsys, resume):
    message = refused(capsys, "train", "--out", tmp_path / "run", *resume)
    assert "SOURCE must name a task or a description" in message
    assert "holds no run to go on with" in message


def test_a_folder_with_something_in_it_is_left_alone(described, arm_run, tmp_path, capsys):
    folder = shutil.copytree(arm_run, tmp_path / "run")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert f"`{folder}` holds a run. Name another folder" in refused(capsys, "reproduce", "--out", folder)
    assert "--resume" in refused(capsys, "train", described, "--out", folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("resume", [(), ("--resume",)])
def test_a_folder_that_is_no_run_is_left_alone(described, tmp_path, capsys, resume):
    folder = tmp_path / "full"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    message = refused(capsys, "train", described, "--out", folder, *resume)
    assert "there are other files and no `config.json`. Choose another folder." in message
    assert "it is a file" in refused(capsys, "train", described, "--out", folder / "notes.txt", *resume)
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]


def test_other_settings_than_those_of_the_run_to_continue(arm, arm_run, described, capsys):
    for words, option in (
        ((described,), "SOURCE"),
        ((arm, "--model", "naive"), "--model"),
        ((arm, "--preset", "paper"), "--preset"),
        ((arm, "--space", "R1"), "--space"),
        ((arm, "--seed", "3"), "--seed"),
        ((arm, "--trajectories", "3"), "--trajectories"),
        ((arm, "--noise", "0.1"), "--noise"),
    ):
        assert f"`{option}` must be that of the run" in refused(capsys, "train", *words, "--out", arm_run, "--resume")


def test_other_data_than_those_of_the_run_to_continue(arm, arm_run, tmp_path, capsys):
    data = shutil.copytree(arm.parent, tmp_path / "data")
    folder = shutil.copytree(arm_run, tmp_path / "run")
    config = folder / "config.json"
    config.write_text(config.read_text().replace(str(arm.parent), str(data)))
    rewrite(data / "a.csv", cell(3, 3, "0.5"))
    assert "have changed" in refused(capsys, "train", data / "arm.toml", "--out", folder, "--resume")


def test_data_of_another_mechanism(arm_run, described, tmp_path, capsys):
    assert "must have the space of the run" in refused(capsys, "evaluate", arm_run, "cartpole")
    described.write_text(described.read_text().replace('inputs = ["u"]\ninput_matrix = [[1]]', ""))
    message = refused(capsys, "predict", arm_run, described, "--out", tmp_path / "a.npz")
    assert "1 and velocities; got 0 and velocities" in message


def test_what_is_no_run(tmp_path, capsys):
    for command in (("evaluate",), ("inspect",), ("predict", "pendulum", "--out", tmp_path / "a.npz")):
        name, *others = command
        assert "must be the folder of a run" in refused(capsys, name, tmp_path / "run", *others)


@pytest.mark.parametrize("damage", ["truncated", "tampered", "empty", "absent"])
def test_damaged_models(arm_run, tmp_path, capsys, damage):
    folder = shutil.copytree(arm_run, tmp_path / "run")
    path = folder / "model.safetensors"
    data = bytearray(path.read_bytes())
    data[-3] ^= 255
    contents = {"truncated": data[: len(data) // 2], "tampered": data, "empty": b""}
    path.unlink() if damage == "absent" else path.write_bytes(bytes(contents[damage]))
    assert "model.safetensors" in refused(capsys, "inspect", folder)


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_a_truncated_file_of_arrays(described, tmp_path, capsys, ending):
    arrays = {"t": np.arange(9.0), "q": np.ones((9, 1)), "v": np.ones((9, 1)), "u": np.ones((9, 1))}
    np.savez(tmp_path / "full.npz", **arrays)
    with h5py.File(tmp_path / "full.h5", "w") as file:
        file.update(arrays)
    cut = tmp_path / f"cut.{ending}"
    cut.write_bytes((tmp_path / f"full.{ending}").read_bytes()[:300])
    described.write_text(described.read_text().replace("a.csv", cut.name))
    assert cut.name in refused(capsys, "train", described, "--out", tmp_path / "run")


def test_a_full_disk(tmp_path, capsys, monkeypatch):
    path = tmp_path / "data.npz"
    path.write_text("what was there before")

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    assert "No space left" in refused(capsys, "simulate", "pendulum", "--out", path, status=1)
    assert path.read_text() == "what was there before"
    assert [each.name for each in tmp_path.iterdir()] == ["data.npz"]
