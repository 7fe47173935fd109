"""Choice of the mobility, by its place in MOBILITIES: what a step asks of it, explicit or implicit."""

from numba import njit

from . import free_drain, implicit_drain, rpy

MOBILITIES = ("freeDrain", "rpy")

_drain_rates, _drain_stage = free_drain.link_rates, implicit_drain.stage
_rpy_rates, _rpy_stage = rpy.link_rates, rpy.stage


def work_rows(mobility: int, beads: int, implicit: bool) -> int:
    """Rows of scratch that link_rates or stage needs for fibers of so many beads."""
    if mobility == 1:
        return rpy.work_rows(beads, implicit)
    return implicit_drain.work_rows(beads) if implicit else 6 * beads


@njit
def link_rates(mobility, state, velocity, rotation, beta, radius, law, work, multipliers, rates):
    """Rates of the links and the centre of mass: see free_drain.link_rates."""
    if mobility == 1:
        return _rpy_rates(state, velocity, rotation, beta, radius, law, work, multipliers, rates)
    return _drain_rates(state, velocity, rotation, beta, radius, law, work, multipliers, rates)


@njit
def stage(
    mobility, state, velocity, rotation, history, lagged, sigma, beta, radius, law, work, multipliers, rates
):
    """Rates of a linearly implicit stage: see implicit_drain.stage."""
    if mobility == 1:
        _rpy_stage(
            state, velocity, rotation, history, lagged, sigma, beta, radius, law, work, multipliers, rates
        )
    else:
        _drain_stage(
            state, velocity, rotation, history, lagged, sigma, beta, radius, law, work, multipliers, rates
        )
