"""Options of localisation: names and defaults of nav2_amcl where they are the same thing."""

from __future__ import annotations

from typing import Literal, TypedDict

LaserModel = Literal["likelihood_field", "beam"]


class Options(TypedDict, total=False):
    """What may be said to `localise`, by keyword.

    Attributes:
        laser_model_type: "likelihood_field" or "beam".
        max_beams: of each scan.
        laser_min_range, laser_max_range: m; -1 for the sensor's own.
        z_hit, z_short, z_max, z_rand: shares of beams; short and max of the beam model only.
        sigma_hit: m; 0.1, since nav2's 0.2 lets clutter before the walls pull at the pose; doubled
            until the particles agree.
        lambda_short: 1/m.
        laser_likelihood_max_dist: m.
        alpha1, alpha2, alpha3, alpha4: noise of the odometry, see motion.Alphas.
        update_min_d, update_min_a: m or rad to move before the next update.
        min_particles, max_particles, pf_err, pf_z, resample_interval: see amcl.Parameters.
        recovery_alpha_slow, recovery_alpha_fast: likewise.
        global_particles, effective_beams: likewise; not in nav2.
        match_beams: of each scan, of scan matching and FastSLAM.
        match_window, match_angle: m and rad to each side of a guess that scan matching searches
            at least.
        particles: of FastSLAM, as GMapping has it.
    """

    laser_model_type: LaserModel
    max_beams: int
    laser_min_range: float
    laser_max_range: float
    z_hit: float
    z_short: float
    z_max: float
    z_rand: float
    sigma_hit: float
    lambda_short: float
    laser_likelihood_max_dist: float
    alpha1: float
    alpha2: float
    alpha3: float
    alpha4: float
    update_min_d: float
    update_min_a: float
    min_particles: int
    max_particles: int
    pf_err: float
    pf_z: float
    resample_interval: int
    recovery_alpha_slow: float
    recovery_alpha_fast: float
    global_particles: int
    effective_beams: float
    match_beams: int
    match_window: float
    match_angle: float
    particles: int


DEFAULTS: Options = {
    "laser_model_type": "likelihood_field",
    "max_beams": 60,
    "laser_min_range": -1.0,
    "laser_max_range": 100.0,
    "z_hit": 0.5,
    "z_short": 0.05,
    "z_max": 0.05,
    "z_rand": 0.5,
    "sigma_hit": 0.1,
    "lambda_short": 0.1,
    "laser_likelihood_max_dist": 2.0,
    "alpha1": 0.2,
    "alpha2": 0.2,
    "alpha3": 0.2,
    "alpha4": 0.2,
    "update_min_d": 0.25,
    "update_min_a": 0.2,
    "min_particles": 2000,
    "max_particles": 5000,
    "pf_err": 0.05,
    "pf_z": 0.99,
    "resample_interval": 1,
    "recovery_alpha_slow": 0.0,
    "recovery_alpha_fast": 0.0,
    "global_particles": 100_000,
    "effective_beams": 8.0,
    "match_beams": 180,
    "match_window": 0.3,
    "match_angle": 0.35,
    "particles": 50,
}
# Least and most of each.
RANGES: dict[str, tuple[float, float]] = {
    "max_beams": (1, 1e6),
    "laser_min_range": (-1.0, 1e6),
    "laser_max_range": (-1.0, 1e6),
    "z_hit": (0.0, 1.0),
    "z_short": (0.0, 1.0),
    "z_max": (0.0, 1.0),
    "z_rand": (1e-9, 1.0),  # without it a reading may be impossible from every particle
    "sigma_hit": (1e-3, 1e3),
    "lambda_short": (1e-9, 1e6),
    "laser_likelihood_max_dist": (1e-3, 1e3),
    "alpha1": (0.0, 1e3),
    "alpha2": (0.0, 1e3),
    "alpha3": (0.0, 1e3),
    "alpha4": (0.0, 1e3),
    "update_min_d": (0.0, 1e6),
    "update_min_a": (0.0, 1e6),
    "min_particles": (1, 10_000_000),
    "max_particles": (1, 10_000_000),
    "pf_err": (1e-6, 1e3),
    "pf_z": (0.0, 10.0),
    "resample_interval": (1, 1e6),
    "recovery_alpha_slow": (0.0, 1.0),
    "recovery_alpha_fast": (0.0, 1.0),
    "global_particles": (1, 10_000_000),
    "effective_beams": (1e-9, 1e6),
    "match_beams": (1, 1e6),
    "match_window": (0.0, 10.0),
    "match_angle": (0.0, 3.2),
    "particles": (1, 10_000),
}
