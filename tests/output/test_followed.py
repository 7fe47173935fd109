"""Row 15: another program looks at a recording while it grows, in the way that docs/files.md names."""

from __future__ import annotations

import h5py

from gbm_plugin.output.recording import Recorder, open_recording

from sample_records import FAMILIES, SCENE, records


def test_plain_hdf5_opened_anew_for_each_look(tmp_path):
    path = tmp_path / "fibers.h5"
    with Recorder(path, FAMILIES, **SCENE) as recorder:
        for step in range(200):
            recorder.append(step, 0.1 * step, records(step))
            if step % 20 == 0:
                with h5py.File(path) as file:
                    assert len(file["time"]) == step + 1 and file["step"][-1] == step
                with open_recording(path) as recording:
                    assert len(recording.times) == step + 1
