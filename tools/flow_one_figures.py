"""Tables and figures of the spectral solver's long runs, from the CSV files that flow_one.py keeps.

    python tools/flow_one_figures.py docs/results

reads spectral_flow_I_<n>.csv, spectral_linear_<n>.csv and their spectra there, writes spectral_flow_I.md,
spectral_flow_I.png, spectral_linear.md and spectral_linear.png beside them.
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullFormatter

from gbm_plugin.spectral.presets import PRESETS
from gbm_plugin.statistics.series import TimeSeries

SETTLE = {64: 150.0, 128: 20.0}  # 64^3 starts from rest, 128^3 from the end of the 64^3 run
SETTLE_LINEAR = 25.0
ROWS = {  # quantity: name in the series, the paper's Table 1
    "ε": ("dissipation", "0.0015"),
    "power": ("power", ""),
    "η": ("kolmogorov_length", "0.0286"),
    "Re_λ": ("taylor_reynolds", "51"),
    "λ": ("taylor_length", "0.23 (0.40 from its ν, ε, Re_λ)"),
    "L = (π/2u'²)∫E/k dk": ("integral_length", "0.7"),
    "u'": ("velocity_rms", ""),
    "u'³/ε": ("dissipation_length", ""),
    "skewness of ∂u/∂x": ("velocity_skewness", ""),
    "flatness of ∂u/∂x": ("velocity_flatness", ""),
}

FLOW_ONE = """Preset `flow_I`: ν = 0.001, box 2π, Eswaran–Pope force with variance {force.variance:g},
time scale {force.time_scale:g}, cutoff {force.cutoff:.4f}, seed {force.seed}. Means ± standard error
(correlated samples); times averaged are counted in integral times of ε.

Tuned at 64³, where ε, set by the large scales, is right, but k_max η is too small for the gradients'
skewness and flatness. 128³ continues the 64³ run, with a time step of 0.01 and then 0.0125. Matched are ν, ε,
η and Re_λ. The printed λ = 0.23 contradicts them: λ = 15^(1/4) Re_λ^(1/2) η = 0.40. The printed L = 0.7 is
not matched: a force on larger wavenumbers would lower L, and u' and Re_λ with it. (E–P's own example, cutoff
2√2 and variance 9.83e-7, gives at 64³ ε = 0.00153 ± 0.00002, Re_λ = 60.8 ± 0.4, L = 1.09 ± 0.01.)"""

LINEAR = """f = A(u − <u>) with A = P/2k, P = 0.1, ν = 0.012. Literature: u'³/ε = 0.19 box (Rosales & Meneveau
2005). Ratio of the means over the whole interval; its relative error is that of the mean of u'³/ε."""


def runs(folder: Path, stem: str) -> dict[int, TimeSeries]:
    """Series by resolution."""
    paths = [p for p in folder.glob(f"{stem}_*.csv") if p.stem.split("_")[-1].isdigit()]
    return {int(p.stem.split("_")[-1]): TimeSeries.read(p) for p in sorted(paths, key=lambda p: len(p.stem))}


def flow_one(folder: Path) -> None:
    found = runs(folder, "spectral_flow_I")
    means = {n: {q: s.mean(name, SETTLE[n]) for q, (name, _) in ROWS.items()} for n, s in found.items()}
    lines = ["# Flow I with the spectral solver", ""]
    lines += [FLOW_ONE.format(force=PRESETS["flow_I"].forcing()), ""]
    lines += ["| | paper, Table 1 | " + " | ".join(f"{n}³" for n in found) + " |"]
    lines += ["|---|---|" + "---|" * len(found)]
    for q, (_, paper) in ROWS.items():
        lines.append(f"| {q} | {paper} | " + " | ".join(str(means[n][q]) for n in found) + " |")
    spans = [
        f"{m['ε'].duration:.0f} = {m['ε'].duration / m['ε'].correlation_time:.0f} × " for m in means.values()
    ]
    times = [f"{m['ε'].correlation_time:.3g}" for m in means.values()]
    lines.append("| time averaged | | " + " | ".join(a + b for a, b in zip(spans, times, strict=True)) + " |")
    resolved = [(n - 1) // 3 * means[n]["η"].value for n in found]
    lines.append("| k_max η | | " + " | ".join(f"{r:.2f}" for r in resolved) + " |")
    lines += ["", "![dissipation in time and compensated spectra](spectral_flow_I.png)"]
    (folder / "spectral_flow_I.md").write_text("\n".join(lines) + "\n")

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for n, s in found.items():
        left.plot(s["time"], s["dissipation"], lw=0.8, label=f"{n}³")
        k, e = np.loadtxt(folder / f"spectral_flow_I_{n}_spectrum.csv", delimiter=",", skiprows=1).T
        eps, eta = means[n]["ε"].value, means[n]["η"].value
        kept = (k > 0) & (k <= (n - 1) // 3)
        right.loglog(k[kept] * eta, (e * k ** (5 / 3))[kept] / eps ** (2 / 3), ".-", label=f"{n}³")
    left.axhline(0.0015, color="k", lw=0.8, ls=":")
    left.set(xlabel="t", ylabel="ε", ylim=(0, None))
    right.axhline(1.6, color="k", lw=0.8, ls=":")
    right.set(xlabel="kη", ylabel=r"$E(k)\, k^{5/3} \varepsilon^{-2/3}$", ylim=(1e-2, 5))
    right.xaxis.set_minor_formatter(NullFormatter())
    for axis in (left, right):
        axis.legend()
    figure.savefig(folder / "spectral_flow_I.png", dpi=130)


def linear(folder: Path) -> None:
    found = runs(folder, "spectral_linear")
    lines = ["# Stationary linear forcing (constant power) with the spectral solver", ""]
    lines += [LINEAR, ""]
    head = ["cells", "Re_λ", "u'³/ε / box (≈ 0.19)", "ε", "power", "turnovers k/ε", "turnovers L/u'"]
    lines += [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    for n, s in found.items():
        mean = {q: s.mean(q, SETTLE_LINEAR) for q in s.columns if q not in ("time", "power")}
        # the ratio of means over the whole interval, with the relative error of the ratio's series
        rms, eps = np.sqrt(2 / 3 * mean["kinetic_energy"].value), mean["dissipation"].value
        error = mean["dissipation_length"].error / mean["dissipation_length"].value
        ratio = rms**3 / eps / (2 * np.pi)
        span = mean["dissipation"].duration
        eddies = [span * eps / mean["kinetic_energy"].value, span / mean["turnover_time"].value]
        lines.append(
            f"| {n}³ | {mean['taylor_reynolds']} | {ratio:.4f} ± {ratio * error:.4f} | "
            f"{mean['dissipation']} | {s['power'].mean():.6g} | {eddies[0]:.0f} | {eddies[1]:.0f} |"
        )
        axis.plot(s["time"], s["dissipation_length"] / (2 * np.pi), lw=0.8, label=f"{n}³")
    axis.axhline(0.19, color="k", lw=0.8, ls=":")
    axis.set(xlabel="t", ylabel="u'³/(ε box)", ylim=(0, None))
    axis.legend()
    figure.savefig(folder / "spectral_linear.png", dpi=130)
    lines += ["", "![u'^3/eps in time](spectral_linear.png)"]
    (folder / "spectral_linear.md").write_text("\n".join(lines) + "\n")


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/results")
    flow_one(folder)
    linear(folder)


if __name__ == "__main__":
    main()
