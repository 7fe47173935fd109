import os

import numpy as np
import pytest

from gbm_plugin.output.tables import read_dat, read_forcing


def put(folder, start, text):
    (folder / start).mkdir(parents=True)
    (folder / start / "some.dat").write_text(text)


def test_numbers_and_vectors(tmp_path):
    put(
        tmp_path,
        "0",
        "# Energy\n# box : 1\n# Time\tk     meanU p\n0.1 1e-3 (1 -2 3e2) 5\n0.2\t2e-3\t(4 5 6)\tnan\n",
    )
    table = read_dat(tmp_path, "some.dat")
    assert list(table) == ["Time", "k", "meanU", "p"]
    np.testing.assert_array_equal(table["meanU"], [[1, -2, 300], [4, 5, 6]])
    np.testing.assert_array_equal(table["k"], [1e-3, 2e-3])
    assert table["p"][0] == 5 and np.isnan(table["p"][1])


def test_later_starts_override(tmp_path):
    """Folders are ordered as numbers; a start time written in fewer digits is the same time."""
    put(tmp_path, "0", "# Time k\n" + "".join(f"{t} 0\n" for t in range(1, 13)))
    put(tmp_path, "10", "# Time k\n" + "".join(f"{t} 2\n" for t in (11.0, 12, 13)))
    put(tmp_path, "9", "# Time k\n" + "".join(f"{t} 1\n" for t in (10.00001, 11, 12, 13, 14)))
    put(tmp_path, "notATime", "# Time other\n")
    put(tmp_path, "13", "# Time k\n")
    table = read_dat(tmp_path, "some.dat")
    np.testing.assert_allclose(table["Time"], range(1, 14), atol=1e-4)
    np.testing.assert_array_equal(table["k"], [0] * 9 + [1] + [2] * 3)


def test_unfinished_last_line_is_left_out(tmp_path):
    put(tmp_path, "0", "# Time k\n1 10\n2 20\n3 3")
    np.testing.assert_array_equal(read_dat(tmp_path, "some.dat")["k"], [10, 20])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2\n", "no header line"),
        ("# Time k\n1 2\n2\n3 4\n", "line 3: 1 entries for 2 columns"),
        ("# Time k\n1 two\n", "not a table of numbers"),
    ],
)
def test_bad_file(tmp_path, text, message):
    put(tmp_path, "0", text)
    with pytest.raises(ValueError, match=message):
        read_dat(tmp_path, "some.dat")


def test_missing_and_different(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no some\.dat in"):
        read_dat(tmp_path, "some.dat")
    put(tmp_path, "0", "# Time k\n1 2\n")
    put(tmp_path, "1", "# Time e\n1 2\n")
    with pytest.raises(ValueError, match="has columns Time, e;"):
        read_dat(tmp_path, "some.dat")
    (tmp_path / "1/some.dat").write_text("# Time e k\n2 2 3\n")  # as with feedback switched on at a restart
    table = read_dat(tmp_path, "some.dat")
    np.testing.assert_array_equal(table["k"], [2, 3])
    np.testing.assert_array_equal(table["e"], [np.nan, 2])


def test_the_table_of_a_forcing_is_found_by_its_columns(tmp_path):
    """Whatever the forcing is called; of two the newer."""
    with pytest.raises(FileNotFoundError, match="no table of a forcing"):
        read_forcing(tmp_path)
    for age, (name, columns) in enumerate(
        [("old", "epsilonBudget"), ("stirring", "k\tepsilonBudget"), ("probes", "U")]
    ):
        file = tmp_path / "postProcessing" / name / "0" / f"{name}.dat"
        file.parent.mkdir(parents=True)
        file.write_text(f"# Time\t{columns}\n" + "\t".join("0123"[: 1 + len(columns.split())]) + "\n")
        os.utime(file, (100 + age, 100 + age))
    assert list(read_forcing(tmp_path)) == ["Time", "k", "epsilonBudget"]
