import pytest

from gbm_plugin.output.recording import Recorder

from sample_records import FAMILIES, SCENE, records


@pytest.fixture
def write(tmp_path):
    """Write a recording of the steps given, 0.1 s apart, to <folder>/fibers.h5 and return its path."""

    def write(steps, folder="0"):
        path = tmp_path / "postProcessing" / "fibers" / folder / "fibers.h5"
        with Recorder(path, FAMILIES, **SCENE) as recorder:
            for step in steps:
                recorder.append(step, 0.1 * step, records(step))
        return path

    return write
