"""Makes the fuel map of trucks/longhaul.toml: the form of a measured map at a present level.

    flow = w [ a (1 + (T / T_best)^2) + a1 u + T (b + b2 u^2) ],   u = (n - n_best) / 1000 rpm

w in rad/s, T brake torque in Nm. a: what the engine takes without load, per radian; b: the
marginal consumption; the square: what dear full load adds, such that the best point lies at
(n_best, T_best) = (1150 rpm, 1781 Nm), where the map of the release of Wang et al. (a 13 l
engine) has it. Coefficients: least squares of the relative error over the ADVISOR map from 400 Nm
and up to 2000 rpm, its speeds less 250 rpm (present engines run that much slower: full torque from
1000 instead of 1200 rpm). Level: 189 g/kWh at 129 kW and 1141 rpm (a 55 t truck's 80 km/h).

Run: python fit.py
"""

import csv
import pathlib

import numpy as np

BEST_RPM, BEST_NM = 1150.0, 1781.0
CRUISE_RPM, CRUISE_KW, CRUISE_G_KWH = 1141.0, 129.0, 189.0
SLOWER_RPM = 250.0
RPM_PER_RAD_S = 60.0 / (2.0 * np.pi)


def per_radian(rpm, nm):
    """Terms of the flow per engine speed, g per rad."""
    u = (np.asarray(rpm) - BEST_RPM) / 1000.0
    nm = np.asarray(nm)
    return np.stack([1.0 + (nm / BEST_NM) ** 2, u + 0.0 * nm, nm + 0.0 * u, nm * u * u], axis=-1)


def main():
    """Fits, prints coefficients, error and the map in the form of a truck file."""
    with (pathlib.Path(__file__).parent / "bsfc_map.csv").open() as file:
        rows = [tuple(float(v) for v in list(r.values())[:3]) for r in csv.DictReader(file)]
    rpm, nm, bsfc = np.array([r for r in rows if r[1] >= 400.0 and r[0] <= 2000.0]).T
    target = bsfc * nm / 3.6e6  # g per rad
    terms = per_radian(rpm - SLOWER_RPM, nm)
    x = np.linalg.lstsq(terms / target[:, None], np.ones_like(target), rcond=None)[0]
    error = terms @ x / target - 1.0
    print(f"# relative error: rms {np.sqrt(np.mean(error**2)):.4f}, worst {np.abs(error).max():.4f}")
    cruise_nm = CRUISE_KW * 1e3 / (CRUISE_RPM / RPM_PER_RAD_S)
    x *= CRUISE_G_KWH / (per_radian(CRUISE_RPM, cruise_nm) @ x / cruise_nm * 3.6e6)
    best = per_radian(BEST_RPM, BEST_NM) @ x / BEST_NM * 3.6e6
    print(f"# coefficients {x}, best point {best:.1f} g/kWh")
    speeds = np.arange(600.0, 2101.0, 150.0)
    torques = np.arange(0.0, 2601.0, 200.0)
    print("speed_rpm =", speeds.tolist())
    print("torque_nm =", torques.tolist())
    print("fuel_g_s = [")
    for n in speeds:
        flow = n / RPM_PER_RAD_S * (per_radian(n, torques) @ x)
        print("    [" + ", ".join(f"{v:.4f}" for v in flow) + "],")
    print("]")


if __name__ == "__main__":
    main()
