"""Fibers in a case that knows nothing of this project: five lines in controlDict and one dictionary."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from gbm_plugin.case.openfoam import utility
from gbm_plugin.output.recording import open_recording

from conftest import DEFAULT_CASE, FAMILY, HEADER, gbm, set_entry, start_solver

pytestmark = pytest.mark.openfoam

README = Path(__file__).parents[2] / "README.md"


STOCK_SCHEMES = """ddtSchemes { default Euler; }
gradSchemes { default Gauss linear; }
divSchemes { default Gauss linear; }
laplacianSchemes { default Gauss linear corrected; }
interpolationSchemes { default linear; }
snGradSchemes { default corrected; }
"""


def foreign_case(path: Path, application: str) -> Path:
    """A periodic box with a vortex, as somebody might have it: other names, PISO, no forcing, times from 2."""
    shutil.copytree(
        DEFAULT_CASE, path, ignore=shutil.ignore_patterns("0", "[1-9]*", "post*", "report", "log.*")
    )
    for unwanted in ("constant/fiberProperties", "constant/fvOptions", "system/initialFieldDict"):
        (path / unwanted).unlink()
    (path / "constant/turbulenceProperties").write_text(HEADER + "simulationType laminar;\n")
    (path / "system/fvSchemes").write_text(HEADER + STOCK_SCHEMES)
    (path / "0.orig").rename(path / "2")
    set_entry(path / "system/blockMeshDict", "n", "12")
    (path / "system/controlDict").write_text(
        HEADER
        + f"""application {application}; startFrom startTime; startTime 2; stopAt endTime; endTime 2.2; deltaT 0.02;
        writeControl runTime; writeInterval 0.1; writeFormat ascii; writePrecision 10; timePrecision 6;
        """
    )
    solution = path / "system/fvSolution"
    solution.write_text(solution.read_text() + "\nPISO { nCorrectors 2; pRefCell 0; pRefValue 0; }\n")
    u = path / "2/U"
    u.write_text(u.read_text().replace("uniform (0 0 0)", "uniform (0.5 0.25 -1)"))
    return path


def readme_lines() -> str:
    """The lines that the README tells people to put into their controlDict."""
    block = re.search(r"```\n(functions\n\{.*?\n\})\n```", README.read_text(), re.DOTALL).group(1)
    assert len([line for line in block.splitlines() if line.strip(" {}")]) <= 5
    return block


@pytest.mark.parametrize("application", ["pimpleFoam", "pisoFoam"])
def test_five_lines_and_a_dictionary(tmp_path, application):
    path = foreign_case(tmp_path / "case", application)
    with (path / "system/controlDict").open("a") as file:
        file.write(readme_lines())
    (path / "constant/fiberProperties").write_text(HEADER + f"recordInterval 1; families {{ {FAMILY} }}")
    done = gbm("run", path)
    assert done.returncode == 0, done.stderr
    with open_recording(path / "postProcessing/fibers") as recording:
        x = recording.families["test"].positions[:]
        assert recording.times[0] == pytest.approx(2) and recording.times[-1] == pytest.approx(2.2)
    # a uniform flow carries every fiber as it is
    moved = x[-1] - x[0]
    np.testing.assert_allclose(
        moved, np.broadcast_to(0.2 * np.array([0.5, 0.25, -1]), moved.shape), atol=1e-9
    )


def test_by_hand(tmp_path):
    """The solver and the daemon started by the user, as the README says."""
    import subprocess
    import sys

    path = foreign_case(tmp_path / "case", "pimpleFoam")
    with (path / "system/controlDict").open("a") as file:
        file.write(readme_lines())
    (path / "constant/fiberProperties").write_text(HEADER + f"families {{ {FAMILY} }}")
    utility(path, "blockMesh")
    daemon = subprocess.Popen([sys.executable, "-m", "gbm_plugin.cli", "daemon", str(path)])
    assert start_solver(path).wait() == 0
    assert daemon.wait() == 0
