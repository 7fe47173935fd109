"""The pseudo-spectral Navier-Stokes solver of the periodic box."""

import warnings
from collections import deque

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbm_plugin.arrays import Form, check_arrays
from gbm_plugin.sampling import NEEDS, one_of
from gbm_plugin.spectral import interpolation as interpolate
from gbm_plugin.spectral.arrays import Array, Arrays
from gbm_plugin.spectral.forcing import Forcing, Unforced
from gbm_plugin.spectral.modes import Modes
from gbm_plugin.spectral.slabs import Slabs
from gbm_plugin.spectral.stepping import AdamsBashforth3, RungeKutta4
from gbm_plugin.statistics import turbulence

SCHEMES = {"ab3": AdamsBashforth3, "rk4": RungeKutta4}
STABLE = {"ab3": 0.34, "rk4": 1.35}  # Courant numbers, of the shortest wave along the fastest direction
LOOK = 10  # steps between looks at the Courant number of a fixed time step
# energy that a step may add, beside what the force can give: that once more, and this part of what there was;
# convection gives none, and AB3 and RK4, where they are stable, take some
BLOWN_UP = 0.02


class SpectralSolver:
    """du/dt + u.grad u = -grad p + nu lap u + f, div u = 0 in a periodic cube, with 2/3 dealiasing.

    cells: even number n of nodes per edge, at x_i = i box/n; viscosity: kinematic, nu; box: edge length;
    forcing: None, `LinearForcing` or `EswaranPope`.
    Either time_step (fixed) or cfl is given; with cfl the step is cfl h/max(|u_x| + |u_y| + |u_z|), h =
    box/n, chosen anew in every step (AB3 is stable below 0.34, RK4 below 1.35).
    scheme: "ab3" (third order, the paper's) or "rk4"; precision: "double" or "single"; threads: of the CPU;
    interpolation: "trilinear" (the paper's), "cubic", "quintic" or "exact", for `sample`; device: "cpu" or "gpu" (needs
    CuPy).

    The fluid starts at rest at time 0. A fixed step beyond those limits is worth a warning: RK4 then
    damps what it should carry. Raises ValueError for a bad value, FloatingPointError where the flow blows up: in the
    step in which it has more energy than its force can give.
    """

    def __init__(
        self,
        cells: int,
        viscosity: float,
        box: float = 2 * np.pi,
        forcing: Forcing | None = None,
        time_step: float | None = None,
        *,
        cfl: float | None = None,
        scheme: str = "ab3",
        threads: int = 1,
        precision: str = "double",
        interpolation: str = "trilinear",
        device: str = "cpu",
    ):
        if (time_step is None) == (cfl is None):
            raise ValueError("SpectralSolver takes exactly one of time_step and cfl")
        for name, value in (("time_step", time_step), ("cfl", cfl)):
            if value is not None and not 0 < value < np.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        one_of("scheme", scheme, SCHEMES)
        one_of("interpolation", interpolation, interpolate.WORDS)
        self.modes = Modes(cells, box)
        self.operators = _operators(device, self.modes, viscosity, precision, threads)
        self.forcing = Unforced() if forcing is None else forcing
        self.forcing.bind(self.operators)
        self.interpolation = interpolation
        self.time, self.step = 0.0, 0
        self.time_step, self.cfl = time_step, cfl
        self._threads = threads
        self._stepper = SCHEMES[scheme](self.operators)
        self._scheme, self._warned = scheme, False
        self._u = self.operators.zeros()
        self._energy = 0.0
        self._points: Array | None = None  # modes of the point forces
        self._densities: NDArray | None = None  # of these at the nodes, to be written over
        self._pushes: deque[float] = deque(maxlen=3)  # rms of these in the last steps
        self._fields: dict[str, Array] = {}  # physical fields of the present time
        self._spare: dict[str, Array] = {}  # those of the past, to be written over

    cells = property(lambda self: self.modes.cells, doc="Nodes per edge.")
    box = property(lambda self: self.modes.box, doc="Edge length.")
    viscosity = property(lambda self: self.operators.viscosity, doc="Kinematic viscosity.")

    @property
    def sample_interval(self) -> float | None:
        """Between the times at which `sample` knows the flow; None where `cfl` chooses them."""
        return self.time_step

    def set_velocity(self, u: ArrayLike) -> None:
        """Set the velocity from node values (3, n, n, n): its mean and its solenoidal, resolved part."""
        u = np.ascontiguousarray(u)  # as the kernels are compiled for
        n = self.cells
        if u.shape != (3, n, n, n):
            raise ValueError(f"velocity must have shape (3, {n}, {n}, {n}), got {u.shape}")
        if not np.isfinite(u).all():
            raise ValueError("velocity must be finite everywhere")
        self._set(self.operators.to_modes(u))

    def _set(self, modes: Array) -> None:
        self._u = self.operators.project(modes)
        self._u[:, 0, 0, 0] = modes[:, 0, 0, 0].real
        self.operators.close(self._u)
        self._energy = self.operators.energy(self._u)
        self._stepper.forget()
        self._discard_fields()

    def set_modes(self, wavevectors: ArrayLike, amplitudes: ArrayLike) -> None:
        """Set the velocity to the solenoidal, resolved part of Re sum a exp(2 pi i m.x/box), from whole m (M, 3) and
        complex a (M, 3)."""
        m, a = np.asarray(wavevectors), np.asarray(amplitudes, complex)
        if m.shape != a.shape or m.shape[1:] != (3,):
            raise ValueError(f"wavevectors and amplitudes must both be (M, 3), got {m.shape} and {a.shape}")
        if not np.isfinite(a).all():
            raise ValueError("amplitudes must be finite")
        modes, cut = np.zeros((3, *self.modes.shape), complex), self.modes.cut
        resolved = (abs(m) <= cut).all(axis=1)
        for sign, values in ((1, a), (-1, a.conj())):
            k = sign * m
            stored = resolved & (k[:, 2] >= 0)
            for component, c in zip(modes, values.T, strict=True):
                np.add.at(component, tuple(k[stored].T), c[stored] / 2)
        self._set(self.operators.xp.asarray(modes.astype(self.operators.complex)))

    @property
    def velocity(self) -> NDArray:
        """Velocity at the nodes, (3, n, n, n), [c, i, j, k] at (i, j, k) box/n."""
        return self.operators.host(self._physical("velocity", lambda: self._u)).copy()

    def shifted_velocity(self, fraction: float) -> NDArray:
        """Velocity (3, n, n, n) at ((i, j, k) + fraction) box/n: 1/2 for the centres of the cells between nodes."""
        u = self.operators.to_physical(self.operators.shifted(self._u, fraction))
        return np.ascontiguousarray(self.operators.host(u))

    @property
    def mean(self) -> NDArray:
        """Mean velocity (3,)."""
        return self.operators.mean(self._u).real.astype(float)

    @property
    def coefficients(self) -> NDArray:
        """Fourier coefficients of the velocity, (3, 2K+1, 2K+1, K+1), ordered as `Modes` says."""
        return self.operators.host(self._u).copy()

    def set_point_forces(
        self, positions: ArrayLike, force: ArrayLike | None, torque: ArrayLike | None = None
    ) -> None:
        """Forces and torques (..., 3) on the fluid at positions (..., 3), over its density, from now on until the next
        call; None: no more.

        They are spread by the transpose of `sample`, torques as half the curl of their density, so that
        sum F.u + T.(curl u)/2 of the sampled flow is the integral of f.u to rounding. Their mean, which would move the
        whole fluid, is left out. The scheme takes them as the rest of du/dt, constant within the first two steps
        of "ab3" and every one of "rk4".
        """
        if force is None:
            self._points = None
            return
        points = np.ascontiguousarray(positions, float).reshape(-1, 3)
        values = np.ascontiguousarray(force, float).reshape(-1, 3)
        if torque is not None:
            values = np.concatenate([values, np.asarray(torque, float).reshape(-1, 3)], axis=1)
        if len(values) != len(points):
            raise ValueError(f"there are {len(values)} forces at {len(points)} positions")
        if not (np.isfinite(points).all() and np.isfinite(values).all()):
            raise ValueError("positions, forces and torques must be finite")
        operators = self.operators
        if self.interpolation == "exact":
            modes = interpolate.fourier_spread(values, points, self.box, self.modes.cut, self._threads)
            modes = operators.xp.asarray(modes, operators.complex)
        else:
            n = self.cells
            if self._densities is None or len(self._densities) != values.shape[1]:
                nodes = np.empty((n, n, n, values.shape[1]), operators.real)
                self._densities = np.moveaxis(nodes, -1, 0)
            spread = (self.interpolation, values, points, self.box, n, self._threads, self._densities)
            modes = operators.to_modes(interpolate.spread_on_grid(*spread))
        self._points = operators.loads(modes)

    def advance(self, steps: int = 1) -> None:
        """Take time steps."""
        for _ in range(steps):
            before = self._energy
            h, self._energy = self._stepper.step(self._u, before, self.time, self._evaluate, self._choose)
            self.operators.close(self._u)
            self.time += h
            self.step += 1
            self._discard_fields()
            self._check_step(before, h)
            self.forcing.advance(h)

    def _check_step(self, before: float, h: float) -> None:
        """FloatingPointError where the energy has grown by more than the force can give."""
        gain = self.forcing.reach(max(before, 0.0), h) - before
        # of the point forces that AB3 remembers, with its weights 23, -16, 5 over 12 all at their worst
        self._pushes.append(self._point_strength())
        push = 44 / 12 * h * max(self._pushes)
        gain += push * np.sqrt(2 * max(before, 0.0)) + 0.5 * push**2
        if self._energy <= before + 2 * gain + BLOWN_UP * before + self._rounding:
            return
        place = f"in step {self.step}, t = {self.time:.6g}, time step {h:.3g}"
        grown = f"its energy grows from {before:.3g} to {self._energy:.3g}, the force can give {gain:.3g}"
        if not np.isfinite(self._energy):
            grown = "its velocity is not finite"
        raise FloatingPointError(f"the flow blows up {place}: {grown}; use a shorter step or a weaker force")

    def _point_strength(self) -> float:
        """Rms of the point forces over the box."""
        return 0.0 if self._points is None else float(np.sqrt(2 * self.operators.energy(self._points)))

    @property
    def _rounding(self) -> float:
        """Of the energy of fluctuations, beside that of the mean."""
        mean = self.operators.mean(self._u)
        return 1e3 * np.finfo(self._u.dtype).eps * float((abs(mean) ** 2).sum())

    def spectrum(self) -> tuple[NDArray, NDArray]:
        """k (S,) and E(k) (S,), eq. (16) of the paper; see `statistics.turbulence.energy_spectrum`."""
        return turbulence.shell_spectrum(self._mode_energy(), self.modes.k, self.modes.k0)

    def statistics(self) -> dict[str, float]:
        """Energies, scales and gradient moments at the present time, by `statistics.turbulence`.

        kinetic_energy, dissipation, velocity_rms, enstrophy, taylor_length, taylor_reynolds,
        kolmogorov_length, kolmogorov_time, integral_length, dissipation_length (u'^3/eps), turnover_time,
        velocity_skewness, velocity_flatness, and power = <u.f>.
        """
        operators, u = self.operators, self._u
        slopes = operators.xp.stack([operators.derivative(u[i], i) for i in range(3)])
        return (
            turbulence.scales(*self.spectrum(), operators.dissipation(u), self.viscosity)
            | turbulence.gradient_moments(operators.host(operators.to_physical(slopes)))
            | {"power": self.forcing.input(u, self._energy)}
        )

    def energetics(self) -> dict[str, float]:
        """kinetic_energy of the fluctuations, power of the forcing, dissipation, and exchange, the power of the point
        forces, at the present time; costs no transform."""
        return {
            "kinetic_energy": self._energy,
            "power": self.forcing.input(self._u, self._energy),
            "dissipation": self.operators.dissipation(self._u),
            "exchange": float(self._mode_exchange().sum()),
        }

    def exchange_spectrum(self) -> tuple[NDArray, NDArray]:
        """k (S,) and the power (S,) that the point forces give to the shells of `spectrum`; its sum times their width,
        2 pi/box, is <f.u>."""
        return turbulence.shell_spectrum(self._mode_exchange(), self.modes.k, self.modes.k0)

    def _mode_exchange(self) -> NDArray:
        if self._points is None:
            return np.zeros(self.modes.shape)
        a, f = self.operators.host(self._u), self.operators.host(self._points)
        return (a.real * f.real + a.imag * f.imag).sum(axis=0, dtype=float) * self.modes.weights

    def energy_budget(self) -> dict[str, float]:
        """rate = d<|u|^2>/2dt = power + exchange + transfer - dissipation; transfer (nonlinear) vanishes to rounding;
        exchange, of point forces, where there are any."""
        slope = self.operators.zeros()
        self._evaluate(self._u, slope, self._energy)
        a, b = self.operators.host(self._u).astype(complex), self.operators.host(slope)
        gain = float(((a * b.conj()).real * self.modes.weights).sum())
        _, power, dissipation, exchange = self.energetics().values()
        transfer, rate = gain - power - exchange, gain - dissipation
        budget = {"power": power, "dissipation": dissipation, "transfer": transfer, "rate": rate}
        return budget if self._points is None else budget | {"exchange": exchange}

    def sample(
        self, positions: ArrayLike, time: float, need: str = "gradient"
    ) -> tuple[NDArray, NDArray | None]:
        """Velocity (..., 3) at positions (..., 3), and what `need` asks for beside it.

        need: "velocity" (nothing more), "rotation" (half the vorticity, (..., 3)) or "gradient" ((..., 3, 3),
        [..., i, j] = du_i/dx_j). The flow is advanced to a later time by whole steps; a time in between, or
        past, is a ValueError. Derivatives are spectrally exact at the nodes and interpolated as the velocity
        is.
        """
        one_of("need", need, NEEDS)
        points = np.ascontiguousarray(positions, float)
        if points.shape[-1:] != (3,):
            raise ValueError(f"positions must have shape (..., 3), got {points.shape}")
        if not np.isfinite(points).all():
            raise ValueError("positions must be finite")
        self._reach(time)
        flat, shape, operators, u = points.reshape(-1, 3), points.shape[:-1], self.operators, self._u
        velocity = self._at(flat, "velocity", lambda: u).reshape(*shape, 3)
        if need == "velocity":
            return velocity, None
        if need == "rotation":
            return velocity, self._at(flat, need, lambda: operators.curl(u) / 2).reshape(*shape, 3)
        columns = [self._at(flat, f"gradient {j}", lambda j=j: operators.derivative(u, j)) for j in range(3)]
        return velocity, np.stack(columns, axis=-1).reshape(*shape, 3, 3)

    def state(self) -> dict[str, NDArray | float]:
        """All that `restore` needs to continue to the same bits: arrays and floats by name."""
        own = {
            "coefficients": self.coefficients,
            "energy": self._energy,
            "time": self.time,
            "step": float(self.step),
        }
        forcing = {f"forcing_{name}": value for name, value in self.forcing.state().items()}
        return own | self._stepper.state() | forcing

    def forms(self) -> dict[str, Form]:
        """What `state` holds: number type and shape of each array, of which those of slopes may be missing."""
        field = (self._u.dtype.str[1:], self._u.shape)
        own = {"coefficients": field} | {name: ("f", ()) for name in ("energy", "time", "step")}
        forcing = {f"forcing_{name}": form for name, form in self.forcing.forms().items()}
        return own | self._stepper.forms(field) | forcing

    def restore(self, state: dict[str, NDArray | float]) -> None:
        """Continue from the `state()` of a solver that was built from the same values. ValueError where it is none:
        also for a velocity that is not solenoidal or has another energy than it says."""
        state = {name: np.asarray(value) for name, value in state.items()}
        coefficients = state["coefficients"]
        if coefficients.shape != self._u.shape or coefficients.dtype != self._u.dtype:
            stored, own = (f"{a.dtype}{a.shape}" for a in (coefficients, self._u))
            raise ValueError(
                f"the stored velocity is {stored}, this solver's {own}: cells and precision must agree"
            )
        forms = self.forms()
        check_arrays(state, forms, [name for name in forms if name.startswith("slope_")])
        self._u = self.operators.xp.array(coefficients)
        self._energy, self.time, self.step = (float(state[name]) for name in ("energy", "time", "step"))
        self._check_flow()
        self.step = int(self.step)
        self._stepper.restore(state)
        prefix = "forcing_"
        self.forcing.restore({k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)})
        self._discard_fields()

    def _check_flow(self) -> None:
        u, rounding = self._u, 1e3 * np.finfo(self._u.dtype).eps
        off = self.operators.project(u) - u
        off[:, 0, 0, 0] = 0
        energy = self.operators.energy(u)
        if abs(off).max() > rounding * abs(u).max() or abs(energy - self._energy) > rounding * energy:
            raise ValueError(
                f"the stored velocity is not solenoidal, or its energy of {energy:g} is not the {self._energy:g} said"
            )
        if self.step < 0 or self.step != int(self.step):
            raise ValueError(f"the stored step is {self.step}")

    def _evaluate(self, u: Array, out: Array, energy: float) -> None:
        """du/dt without viscosity."""
        linear = self.forcing.rate(energy)
        look = self.cfl is not None or (self.step % LOOK == 0 and not self._warned)
        self.operators.nonlinear(u, out, linear, want_speed=look)
        self.forcing.add(out)
        if self._points is not None:
            out += self._points

    def _choose(self) -> float:
        """The length of the step that begins, the velocity at its start having been seen."""
        speed = self.operators.max_speed
        if self.cfl is None:
            self._judge(speed)
            return self.time_step
        if not speed > 0:
            raise ValueError("a time step cannot be chosen by cfl in a fluid at rest: set a velocity first")
        return self.cfl * self.box / self.cells / speed

    def _judge(self, speed: float | None) -> None:
        """A warning, once, where the step is longer than the scheme is stable for."""
        courant = (speed or 0.0) * self.time_step * self.cells / self.box
        if courant > STABLE[self._scheme]:
            self._warned = True
            warnings.warn(
                f"the Courant number is {courant:.2g} at t = {self.time:.6g}, time step {self.time_step:.3g}: "
                f"{self._scheme} is stable below {STABLE[self._scheme]}; take a shorter step",
                stacklevel=5,
            )

    def _mode_energy(self) -> NDArray:
        return self.operators.host(self.operators.mode_energy(self._u))

    def _reach(self, time: float) -> None:
        """Advance by whole steps until `time`."""
        slack = 1e-4 * (self.time_step or 0.0)  # the rounding of many added steps
        while self.time < time - slack:
            self.advance()
        if abs(self.time - time) > max(slack, 1e-12 * abs(time)):
            raise ValueError(f"the flow is known at t = {self.time:.10g}, not at t = {time:.10g}")

    def _discard_fields(self) -> None:
        """The flow has changed."""
        self._spare |= self._fields
        self._fields = {}

    def _physical(self, name: str, modes) -> Array:
        """The fields at the nodes, computed once per time."""
        if name not in self._fields:
            self._fields[name] = self.operators.to_physical(modes(), self._spare.pop(name, None))
        return self._fields[name]

    def _at(self, points: NDArray, name: str, modes) -> NDArray:
        """Three fields at points (P, 3): (P, 3)."""
        if self.interpolation == "exact":
            return interpolate.fourier_sum(self.operators.host(modes()), points, self.box, self._threads)
        scaled = points * (self.cells / self.box)
        return self.operators.at(self.interpolation, self._physical(name, modes), scaled, self._threads)


def _operators(device: str, modes: Modes, viscosity: float, precision: str, threads: int) -> Arrays:
    one_of("device", device, ("cpu", "gpu"))
    if device == "cpu":
        return Slabs(modes, viscosity, precision, threads)
    try:
        import cupy

        cupy.cuda.runtime.getDeviceCount()
    except Exception as error:  # CuPy raises its own kinds for a missing driver or device
        raise ValueError(f'device "gpu" needs CuPy and a CUDA device: {str(error).splitlines()[0]}') from None
    return Arrays(modes, viscosity, precision, cupy)
