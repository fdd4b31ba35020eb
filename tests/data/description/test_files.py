"""Files are found beside their description, or else in the first data directory that has them."""

import pytest

from symoden.data import DataError
from symoden.data.description._files import data_directories, find_files


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A folder `project/examples` with a description, and nothing found elsewhere."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("SYMODEN_DATA", raising=False)
    (tmp_path / "project" / "examples").mkdir(parents=True)
    return tmp_path


def touched(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return path


def test_files_are_sorted_and_folders_are_none(home):
    folder = home / "project" / "examples"
    b, a, c = (touched(folder / f"{name}.csv") for name in "bac")
    touched(folder / "notes.txt")
    (folder / "d.csv").mkdir()
    assert find_files("*.csv", folder / "arm.toml") == (a, b, c)


def test_a_name_with_brackets_is_a_name_first(home):
    path = touched(home / "project" / "examples" / "run[1].csv")
    assert find_files("run[1].csv", path.parent / "arm.toml") == (path,)


def test_absolute_patterns_are_taken_as_they_are(home):
    path = touched(home / "elsewhere" / "run.csv")
    assert find_files(str(home / "else*" / "*.csv"), home / "project" / "arm.toml") == (path,)


def test_the_nearest_folder_with_a_match_wins(home, monkeypatch):
    description = home / "project" / "examples" / "arm.toml"
    places = [
        home / "cache" / "symoden" / "data",
        home / "shared" / "data",
        home / "project" / "data",
        home / "named",
        description.parent,
    ]
    monkeypatch.setenv("SYMODEN_DATA", str(home / "named"))
    for place in places:
        path = touched(place / "arm" / "run.csv")
        assert [found.resolve() for found in find_files("arm/*.csv", description)] == [path.resolve()]


def test_without_settings_the_cache_is_in_the_home_folder(home, monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(home))
    assert data_directories(home / "arm.toml")[-1] == home / ".cache" / "symoden" / "data"


def test_the_error_lists_where_it_looked(home, monkeypatch):
    monkeypatch.setenv("SYMODEN_DATA", str(home / "named"))
    description = home / "project" / "examples" / "arm.toml"
    with pytest.raises(DataError, match=r"no file matches `\*\.csv`; looked in .*SYMODEN_DATA") as caught:
        find_files("*.csv", description)
    for folder in ("project/examples", "named", "project/data", "project/shared/data", "cache/symoden/data"):
        assert f"`{home / folder}`" in str(caught.value)


@pytest.mark.parametrize("pattern", [".", "./"])
def test_a_folder_is_no_pattern(home, pattern):
    with pytest.raises(DataError, match=rf"must be names or patterns; got '{pattern}', which is a folder\. Write for"):
        find_files(pattern, home / "project" / "examples" / "arm.toml")


def test_a_pattern_that_is_none_is_refused(home):
    with pytest.raises(DataError, match=r"`files` must be names or patterns; got 'a\*\*\*/b'|no file matches"):
        find_files("a***/b", home / "arm.toml")
