"""ParaView itself reads the series: where it is installed (Debian: python3-paraview)."""

from __future__ import annotations

import os
import shutil
import subprocess

import pytest

from gbm_plugin.output.recording import open_recording
from gbm_plugin.report.paraview import write_series

from sample_records import FAMILIES

PVPYTHON = shutil.which("pvpython", path="/usr/bin:/usr/local/bin")
READ = """
import sys
from paraview import simple as pv
series = pv.PVDReader(FileName=sys.argv[1])
series.UpdatePipeline(series.TimestepValues[-1])
tubes = pv.Tube(Input=series, Scalars=["POINTS", "radius"], VaryRadius="By Absolute Scalar")
tubes.UpdatePipeline(series.TimestepValues[-1])
arrays = sorted(series.PointData.keys())
print(len(series.TimestepValues), series.GetDataInformation().GetNumberOfCells(), ",".join(arrays))
print(tubes.GetDataInformation().GetNumberOfPoints())
"""


@pytest.mark.slow
@pytest.mark.skipif(PVPYTHON is None, reason="ParaView is not installed")
def test_paraview_reads_polylines_and_makes_tubes(tmp_path, write):
    with open_recording(write(range(0, 6, 2))) as recording:
        path = write_series(recording, tmp_path, wrapped=False)
    script = tmp_path / "read.py"
    script.write_text(READ)
    env = {n: v for n, v in os.environ.items() if not n.startswith(("PYTHON", "VIRTUAL"))}
    done = subprocess.run(
        [PVPYTHON, script, path], capture_output=True, text=True, env=env | {"PATH": "/usr/bin:/bin"}
    )
    assert done.returncode == 0, done.stderr
    times, lines, arrays = done.stdout.splitlines()[0].split()
    assert (int(times), int(lines)) == (3, sum(f.count for f in FAMILIES))
    assert set(arrays.split(",")) >= {
        "curvature",
        "velocity",
        "radius",
        "stiffness",
        "family",
        "fiber",
        "bead",
    }
    assert int(done.stdout.splitlines()[1]) > 6 * sum(f.count * f.beads for f in FAMILIES)
