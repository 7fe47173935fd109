"""The study of a GPU, where there is none: on the CPU it must run, and the CPU agree with itself."""

import pytest

from gbm_plugin.studies.bench import gpu


def test_it_runs_on_what_is_there():
    result = gpu.run(device="cpu", sizes=(24,))
    differences = [r for r in result["rows"] if r["part"] != "step"]
    steps = [r for r in result["rows"] if r["part"] == "step"]
    assert [(r["difference"] == 0, r["difference"] < 1e-5) for r in differences] == [(True, True)] * 3 + [
        (False, True)
    ] * 3
    assert [(s["cells"], s["precision"]) for s in steps] == [(24, "double"), (24, "single")]
    assert all(s["seconds"] > 0 and s["bound"] > 0 and s["sample"] > 0 for s in steps)
    assert len(gpu.table(result).splitlines()) == 8


def test_a_device_that_is_not_there_is_named():
    try:
        import cupy  # noqa: F401
    except ImportError:
        with pytest.raises(ValueError, match="needs CuPy"):
            gpu.run(sizes=(24,))
    else:
        pytest.skip("CuPy is installed")
