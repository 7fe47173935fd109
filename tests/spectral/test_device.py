"""A device of its own memory: what runs on it must never meet an array of the host.

There is none here. NumPy stands in for its arithmetic, with CuPy's rules of what may meet what: a host array in an
operation is a TypeError, and only `asarray` and `get` cross over.
"""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from gbm_plugin.spectral import EswaranPope, LinearForcing, SpectralSolver

from .fields import noise


class OnDevice(np.ndarray):
    """An array in the device's memory."""

    def __array_ufunc__(self, ufunc, method, *inputs, out=(), **options):
        operands = [own(x) for x in inputs]
        options |= {"out": tuple(own(x) for x in out)} if out else {}
        return there(getattr(ufunc, method)(*operands, **options))

    def __array_function__(self, function, types, arguments, options):
        raise TypeError(f"numpy.{function.__name__} of a device array")

    def __array__(self, *_, **__):
        raise TypeError("implicit conversion to a host array")

    def __setitem__(self, index, value):
        np.ndarray.__setitem__(self.view(np.ndarray), index, own(value))

    def get(self):
        return self.view(np.ndarray).copy()


def own(x):
    """The stand-in's memory behind an operand, which must be on the device or a scalar."""
    if isinstance(x, OnDevice):
        return x.view(np.ndarray)
    if isinstance(x, np.ndarray) and x.ndim:
        raise TypeError("Unsupported type numpy.ndarray")
    return x


def there(x):
    return x.view(OnDevice) if isinstance(x, np.ndarray) else np.asarray(x)[...].view(OnDevice)


def library(module):
    """Functions of NumPy that take arrays of the device alone and give such."""

    def given(x):
        return [own(a) for a in x] if isinstance(x, (list, tuple)) else own(x)

    def wrap(function):
        return lambda *a, **o: there(function(*(given(x) for x in a), **o))

    names = ("empty", "zeros", "ones", "stack", "exp", "floor", "rfftn", "irfftn")
    return {name: wrap(getattr(module, name)) for name in names if hasattr(module, name)}


@pytest.fixture
def device(monkeypatch):
    crossing = {
        "asarray": lambda x, dtype=None: there(np.array(x.get() if isinstance(x, OnDevice) else x, dtype)),
        "array": lambda x, dtype=None: there(np.array(x, dtype)),
    }
    cupy = SimpleNamespace(**library(np), **crossing, fft=SimpleNamespace(**library(np.fft)))
    cupy.cuda = SimpleNamespace(runtime=SimpleNamespace(getDeviceCount=lambda: 1))
    monkeypatch.setitem(sys.modules, "cupy", cupy)


@pytest.mark.parametrize("word", ["trilinear", "cubic", "quintic", "exact"])
def test_a_run_on_the_device_is_that_on_the_cpu(device, word):
    """Steps, samples, forces of points, statistics and a restart, without one array on the wrong side."""
    points = np.random.default_rng(1).uniform(-3, 9, (40, 3))
    found = []
    for name in ("cpu", "gpu"):
        force = EswaranPope(variance=0.01, time_scale=0.5, cutoff=2, seed=3)
        solver = SpectralSolver(16, 0.05, forcing=force, time_step=0.01, interpolation=word, device=name)
        solver.set_velocity(noise(16, 2) + 0.2)
        solver.advance(3)
        solver.set_point_forces(points, 0.1 * np.cos(points), 0.1 * np.sin(points))
        solver.advance(2)
        state = solver.state()
        solver.advance()
        solver.restore(state)
        solver.advance()
        velocity, rotation = solver.sample(points, solver.time, "rotation")
        numbers = [np.array(list(d.values())) for d in (solver.statistics(), solver.energetics())]
        fields = [solver.velocity, solver.shifted_velocity(0.5), solver.mean, velocity, rotation]
        found.append([*fields, solver.spectrum()[1], *numbers])
    for here, there in zip(*found, strict=True):
        assert type(there) is np.ndarray
        np.testing.assert_allclose(there, here, rtol=1e-12, atol=1e-13 * abs(here).max())


def test_a_linear_force_and_a_chosen_step(device):
    found = []
    for name in ("cpu", "gpu"):
        solver = SpectralSolver(16, 0.05, forcing=LinearForcing(power=0.1), cfl=0.3, device=name)
        solver.set_velocity(noise(16, 2))
        solver.advance(4)
        found.append(solver.velocity)
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-13 * abs(found[0]).max())
