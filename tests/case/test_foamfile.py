"""OpenFOAM's files read as data: every layout, what OpenFOAM itself writes, and files that want to be more."""

from __future__ import annotations

import gzip
import os
import re
import shutil
import subprocess

import fluidfoam
import numpy as np
import pytest

from gbm_plugin.case.foamfile import read_field, read_list
from gbm_plugin.case.mesh import box_mesh
from gbm_plugin.case.openfoam import environment
from gbm_plugin.output.field import read_velocity
from gbm_plugin.report.report import report
from gbm_plugin.run.openfoam import run_stored

from conftest import divide, make_case, set_entry

U = np.array([[1, 2, 3], [-0.5, 1e-300, 6.02e23], [0, -0.0, 7]])
VECTORS = "(1 2 3) (-0.5 1e-300 6.02e23)\n(0 -0 7)"


def header(kind: str, form: str = "ascii", arch: str = "LSB;label=32;scalar=64") -> bytes:
    return f'FoamFile {{ version 2.0; format {form}; class {kind}; arch "{arch}"; object x; }}\n'.encode()


def ascii_field(value: str) -> bytes:
    return header("volVectorField") + f"dimensions [0 1 -1 0 0 0 0];\ninternalField {value};\n".encode()


ASCII = {
    "as OpenFOAM writes it": f"nonuniform List<vector> \n3\n(\n{VECTORS}\n)\n",
    "in one line": "nonuniform List<vector> 3((1 2 3) (-0.5 1e-300 6.02e23) (0 -0 7))",
    "without a count": f"nonuniform List<vector> ({VECTORS})",
    "with comments": "/* U */ nonuniform List<vector> // n\n3 ((1 2 3) /* ( */ (-0.5 1e-300 6.02e23) // )\n(0 0 7))",
}


@pytest.mark.parametrize("layout", ASCII)
@pytest.mark.parametrize("packed", [False, True])
def test_ascii(layout, packed, tmp_path):
    content = ascii_field(ASCII[layout])
    (tmp_path / ("U.gz" if packed else "U")).write_bytes(gzip.compress(content) if packed else content)
    np.testing.assert_array_equal(read_field(tmp_path / "U"), U)


@pytest.mark.parametrize(
    "arch, dtype", [("LSB;label=32;scalar=64", "<f8"), ("MSB;label=64;scalar=32", ">f4")]
)
def test_binary(arch, dtype, tmp_path):
    values = U.astype(dtype)
    head = header("volVectorField", "binary", arch) + b"internalField nonuniform List<vector> \n3\n("
    (tmp_path / "U").write_bytes(head + values.tobytes() + b")\n;\n")
    np.testing.assert_array_equal(read_field(tmp_path / "U"), values.astype(float))
    head = header("labelList", "binary", arch) + b"2\n("
    (tmp_path / "owner").write_bytes(
        head + np.array([5, -1], ">i8" if "MSB" in arch else "<i4").tobytes() + b")"
    )
    assert read_list(tmp_path / "owner").tolist() == [5, -1]


def test_one_value_for_all(tmp_path):
    for text, count in (("uniform (1 2 3)", 1), ("nonuniform List<vector> 4{(1 2 3)}", 4)):
        (tmp_path / "U").write_bytes(ascii_field(text))
        assert read_field(tmp_path / "U").tolist() == [[1, 2, 3]] * count
    (tmp_path / "U").write_bytes(ascii_field("nonuniform List<vector> 0()"))
    assert read_field(tmp_path / "U").shape == (0, 3)
    (tmp_path / "p").write_bytes(header("volScalarField") + b"internalField uniform 2.5;")
    assert read_field(tmp_path / "p", "scalar").tolist() == [2.5]


REFUSED = {
    "nonuniform List<vector> 4((1 2 3) (1 2 3))": "2 values of the 4",
    "nonuniform List<vector> 2((1 2 3) (1 2 3)) x": "'x' follows the values",
    "nonuniform List<vector> 2((1 2) (1 2 3))": "2 vectors have 5 numbers",
    "nonuniform List<vector> 2((1 2 3) (1 2 x))": "something else than numbers",
    "nonuniform List<vector> 2((1 2 3) (1 2 3)": "not closed",
    "nonuniform List<vector> 1000{(1 2 3)}": "1000 values where there are at most 10",
    "nonuniform List<vector> 99999999999999999999(": "stands where a list must come",
    "nonuniform List<scalar> 2(1 2)": "List<vector>",
    "uniform (1 2)": "1 vectors have 2 numbers",
    "$U": "cut off|'\\$U",
    '#codeStream { code #{ system("id"); #}; }': "#codeStream",
    '#include "/etc/passwd"': "#include",
}


@pytest.mark.parametrize("value", REFUSED)
def test_refused(value, tmp_path):
    (tmp_path / "U").write_bytes(ascii_field(value))
    with pytest.raises(ValueError, match=f"{re.escape(str(tmp_path))}/U: .*(?:{REFUSED[value]})"):
        print(read_field(tmp_path / "U", most=10))


def test_neither_bombs_nor_pipes_nor_folders(tmp_path):
    """Each within a moment and little memory."""
    (tmp_path / "bomb.gz").write_bytes(gzip.compress(header("labelList") + b"9 (" + bytes(80 << 20), 9))
    with pytest.raises(ValueError, match="more than enough"):
        read_list(tmp_path / "bomb")
    with (tmp_path / "sparse").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(ValueError, match="more than enough"):
        read_field(tmp_path / "sparse", most=8)
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "."):
        with pytest.raises(ValueError, match="no file"):
            read_list(tmp_path / name)
    (tmp_path / "equal").write_bytes(header("vectorField") + b"999999999999{(0 0 0)}")
    with pytest.raises(ValueError, match="999999999999 values"):
        read_list(tmp_path / "equal")


def foam(case, program, *options):
    argv = [program, "-case", case, *options]
    subprocess.run(argv, env=environment(), check=True, capture_output=True)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A case of ours: U as gbm writes it, in binary."""
    case = make_case(tmp_path_factory.mktemp("written") / "case", cells=10, steps=2)
    return case


@pytest.mark.parametrize("form, packed", [("ascii", "off"), ("ascii", "on"), ("binary", "off")])
@pytest.mark.openfoam
def test_what_openfoam_writes_and_fluidfoam_reads(written, form, packed, tmp_path):
    """All of OpenFOAM's formats, decomposed ones too: the same numbers, and those that a user's fluidfoam sees."""
    case = shutil.copytree(written, tmp_path / "case")
    own = read_velocity(case, "0", (10, 10, 10))
    control = case / "system/controlDict"
    for name, value in (("writeFormat", form), ("writePrecision", "17")):
        set_entry(control, name, value)
    control.write_text(control.read_text() + f"writeCompression {packed};\n")
    divide(case, 2, (2, 1, 1))
    split = {p: (p / "0/U", p / "0/U.gz") for p in case.glob("processor*")}
    assert len(split) == 2 and all(files[packed == "on"].is_file() for files in split.values())
    (case / "0/U").rename(case / "U.own")
    np.testing.assert_allclose(read_velocity(case, "0", (10, 10, 10)), own, rtol=1e-15, atol=1e-300)
    foam(case, "reconstructPar", "-withZero")
    again = read_velocity(case, "0", (10, 10, 10))
    np.testing.assert_allclose(again, own, rtol=1e-15, atol=1e-300)
    theirs = fluidfoam.readvector(str(case), "0", "U", verbose=False).reshape(3, 10, 10, 10, order="F")
    np.testing.assert_allclose(theirs, again, rtol=0, atol=1e-14)


@pytest.mark.openfoam
def test_meshes(written, tmp_path):
    cells, origin, size = box_mesh(written)
    assert cells == (10, 10, 10)
    np.testing.assert_allclose([*origin, *size], [0, 0, 0, *[2 * np.pi] * 3], atol=1e-9)
    x = np.unique(
        np.round(fluidfoam.readmesh(str(written), verbose=False)[0], 6)
    )  # our case is one that fluidfoam reads
    np.testing.assert_allclose(x, (np.arange(10) + 0.5) * np.pi / 5, atol=1e-6)


CODE = "__import__('pathlib').Path('{}').touch()"


@pytest.mark.openfoam
def test_a_field_is_not_a_program(written, tmp_path):
    """fluidfoam 0.3.1 evaluates what stands in brackets on lines that begin with `dimensions`."""
    case = shutil.copytree(written, tmp_path / "case")
    mark = tmp_path / "owned"
    text = CODE.format(mark).encode()
    content = (case / "0/U").read_bytes()
    evil = content.replace(b"internalField", b"/*\ndimensions [" + text + b"];\n*/\ninternalField", 1)
    evil = re.sub(rb"\ndimensions[^;]*;", b"\ndimensions [" + text + b"];", evil, count=1)
    for time in ("0", "0.02", "0.04"):
        (case / time).mkdir(exist_ok=True)
        (case / time / "U").write_bytes(evil)
    for name in ("points", "owner", "neighbour"):
        file = case / "constant/polyMesh" / name
        file.write_bytes(b"/*\ndimensions [" + text + b"]\n*/\n" + file.read_bytes())
    with pytest.raises(Exception):  # noqa: B017 - whatever it does with a list of None
        fluidfoam.readvector(str(case), "0", "U", verbose=False)
        raise RuntimeError
    assert mark.exists(), "the attack is one"
    mark.unlink()
    report(case)
    run_stored(case)
    assert not mark.exists()
    assert (case / "report/spectrum.csv").is_file() and (case / "stored/0.04/U").is_file()
