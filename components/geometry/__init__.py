"""Directions, rotations and the ellipsoid, as pure functions over arrays: import them from here.

Arguments that are `array_like` broadcast together; NaN, infinity and shapes that do not fit raise
ValueError. Those that are `ndarray` are not checked.
"""

from components.geometry.angles import (
    DEG_PER_RAD,
    RAD_PER_DEG,
    TWO_PI,
    Vector,
    direction_angle,
    east_north_up_axes,
    heading_rad_from_deg,
    longitude_difference_deg,
    longitude_difference_rounded,
    normal_to_degrees,
    remainder,
    sine_and_cosine,
    slope_angle,
    wrap_by_sines,
    wrap_difference_rad,
    wrap_heading_rad,
    wrap_longitude_deg,
    wrap_negative_to_positive_rad,
    wrap_pi,
    wrap_pi_unchecked,
    wrap_two_pi,
)
from components.geometry.attitude import (
    aspect_angles,
    body_angles,
    body_angles_unchecked,
    body_to_ned,
    components_in_turned_axes,
    line_of_sight_in_target_axes,
    ned_to_body,
    ned_to_body_unchecked,
    normalize_azimuths,
    relative_attitude,
    unit_vector,
    unit_vector_unchecked,
)
from components.geometry.directions import (
    angle_between,
    angle_between_vectors,
    angle_by_haversine,
    angle_of_chord,
    chord_between,
    unit_vectors,
)
from components.geometry.earth_models import (
    EARTH_MODELS,
    LineOfSight,
    SeenFromOwnship,
    east_north_m,
    east_north_mps,
    find_plane_scale,
    geodesic_line_of_sight,
)
from components.geometry.ellipsoid import (
    ECCENTRICITY_SQUARED,
    FLATTENING,
    LARGEST_OFFSET_M,
    SEMI_MAJOR_AXIS_M,
    azimuth_elevation_range_from_neu,
    enu_to_geodetic,
    line_of_sight,
    line_of_sight_ned,
    north_east_up_offsets_m,
    radii_of_curvature,
    slant_range_m,
)
from components.geometry.field_of_view import FieldOfView, sector_width_rad, unwrap_sector
from components.geometry.meridians import (
    NEAR_A_POLE_DEG,
    meridian_convergence_rad,
    north_east_parts,
    rotate_to_meridian,
)
from components.geometry.sensor_axes import (
    body_angles_of_offsets,
    body_angles_of_sight_line,
    rotate_variances,
)
from components.geometry.state import POSE_FIELDS, POSITION_FIELDS, TrajectoryState
