"""Small families of fibers that the tests record."""

import numpy as np

from gbm_plugin.output.recording import FamilyRecord

BOX = 2 * np.pi
SCENE = dict(
    box_origin=(0.0, 0.0, 0.0),
    box_size=(BOX, BOX, BOX),
    dynamic_viscosity=1e-3,
    density=1.0,
    dictionaries={"constant/fiberProperties": "families { }\n", "system/controlDict": "deltaT 0.01;\n"},
    program_version="0.1.0",
)
FAMILIES = (
    FamilyRecord("stiff", 4, 6, 0.05, 1e-3, 7, {"mobility": "freeDrain", "integrator": "implicit"}),
    FamilyRecord("soft", 3, 10, 0.02, np.array([1e-6, 2e-6, 3e-6])),
)


def chains(family: FamilyRecord, seed: int) -> np.ndarray:
    """Random walks (F, N, 3) with links of exactly 2a that turn by small random angles."""
    random = np.random.default_rng(seed)
    tangent = random.normal(size=(family.count, 3))
    points = [random.uniform(0, BOX, size=(family.count, 3))]
    for _ in range(family.beads - 1):
        tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
        points.append(points[-1] + 2 * family.radius * tangent)
        tangent = tangent + 0.3 * random.normal(size=tangent.shape)
    return np.stack(points, axis=1)


def records(step: int) -> list[np.ndarray]:
    """What the tests record at a step: different at every step, and known again from the step alone."""
    return [chains(family, seed=1000 * number + step) for number, family in enumerate(FAMILIES)]
