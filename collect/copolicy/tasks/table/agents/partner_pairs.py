"""Profiles of eight further simulated pairs, from whose episodes partners of robots are trained.

`copolicy-collect simulate` uses them only if they are named, so that no published data set has them: a robot that
learned from `pairs-sim-376` or `pairs-sim-3000` never saw them. They vary what the pairs S01 to S05 vary, in other
combinations and beyond their range (speed 38 to 49 px/s, reaction 0.07 to 0.3 s), within what carries a table.
"""

from .profiles import PlayerProfile

PARTNER_PAIRS: dict[str, tuple[PlayerProfile, PlayerProfile]] = {
    # Slow and careful, both late to react.
    "S06": (
        PlayerProfile(speed=38.0, delay_steps=8, noise=0.05, impulsiveness=0.2, clearance=2.0, patience_s=1.2),
        PlayerProfile(speed=40.0, delay_steps=9, noise=0.05, impulsiveness=0.2, clearance=2.0, patience_s=1.6),
    ),
    # Fast and strong; close to the obstacles.
    "S07": (
        PlayerProfile(speed=49.0, effort=1.1, delay_steps=2, clearance=1.5, patience_s=1.0),
        PlayerProfile(speed=49.0, effort=1.1, delay_steps=3, clearance=1.5, patience_s=1.3),
    ),
    # The human's seat leads by far; the robot's seat follows at once.
    "S08": (
        PlayerProfile(speed=44.0, effort=0.85, delay_steps=6, patience_s=0.3, impulsiveness=0.3),
        PlayerProfile(speed=48.0, effort=1.15, delay_steps=3, patience_s=4.0, impulsiveness=0.2, left_bias=-25.0),
    ),
    # The robot's seat leads by far.
    "S09": (
        PlayerProfile(speed=48.0, effort=1.15, delay_steps=3, patience_s=4.0, impulsiveness=0.2, left_bias=25.0),
        PlayerProfile(speed=44.0, effort=0.85, delay_steps=6, patience_s=0.3, impulsiveness=0.3),
    ),
    # Both like the same side, and accept detours.
    "S10": (
        PlayerProfile(left_bias=30.0, route_temperature=140.0, patience_s=1.1, delay_steps=5),
        PlayerProfile(left_bias=30.0, route_temperature=140.0, patience_s=0.8, delay_steps=4),
    ),
    # Unsteady: strong pulses, noise, more slips and pauses.
    "S11": (
        PlayerProfile(impulsiveness=0.6, noise=0.16, slips_per_min=2.0, pauses_per_min=3.0, patience_s=0.9),
        PlayerProfile(impulsiveness=0.6, noise=0.16, slips_per_min=2.0, pauses_per_min=3.0, patience_s=1.1),
    ),
    # Steady, patient, mostly on the shorter route.
    "S12": (
        PlayerProfile(speed=46.0, noise=0.05, impulsiveness=0.1, route_temperature=40.0, patience_s=2.0),
        PlayerProfile(speed=45.0, noise=0.05, impulsiveness=0.1, route_temperature=40.0, patience_s=1.7, delay_steps=6),
    ),
    # Routes almost at random, soon given up; wide around the obstacles.
    "S13": (
        PlayerProfile(route_temperature=220.0, patience_s=0.5, clearance=2.2, delay_steps=5),
        PlayerProfile(route_temperature=220.0, patience_s=0.6, clearance=2.2, delay_steps=7),
    ),
}
"""Profiles by name: (robot's seat, human's seat)."""
