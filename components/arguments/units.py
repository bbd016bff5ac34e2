"""Units that are not SI ones, standard gravity and the speed of light: exact by definition."""

FOOT_M = 0.3048
NAUTICAL_MILE_M = 1852.0
KNOT_M_S = NAUTICAL_MILE_M / 3600.0
FOOT_PER_MINUTE_M_S = FOOT_M / 60.0
STANDARD_GRAVITY_M_S2 = 9.80665
SPEED_OF_LIGHT_M_S = 299_792_458.0
