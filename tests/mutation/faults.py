"""All faults, group by group."""

import faults_of_alerting
import faults_of_clocks
import faults_of_columns
import faults_of_consoles
import faults_of_effects
import faults_of_encounters
import faults_of_frames
import faults_of_fused_tracks
import faults_of_lock_step
import faults_of_measurements
import faults_of_metrics
import faults_of_scored_tracks
import faults_of_studies
import faults_of_units
import faults_of_wiring
from fault import Fault

_GROUPS = (
    faults_of_wiring, faults_of_frames, faults_of_units, faults_of_clocks, faults_of_effects,
    faults_of_metrics, faults_of_studies, faults_of_columns, faults_of_measurements,
    faults_of_encounters, faults_of_alerting, faults_of_consoles, faults_of_scored_tracks,
    faults_of_fused_tracks, faults_of_lock_step,
)  # fmt: skip

FAULTS: list[Fault] = [fault for group in _GROUPS for fault in group.FAULTS]
