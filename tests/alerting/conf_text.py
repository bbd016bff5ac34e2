"""A small configuration for tests: two levels, all sizes unequal."""

CONF = """\
# for tests
alerters = One_Two, One
corrective_region = MID
ownship_centric_alerting = false
hysteresis_time = 5 [s]
persistence_time = 4 [s]
alerting_m = 2
alerting_n = 4

One_Two_load_core_detection_far = gov.nasa.larcfm.ACCoRD.WCV_TAUMOD
One_Two_far_WCV_DTHR = 0.7 [nmi]
One_Two_far_WCV_ZTHR = 500 [ft]
One_Two_far_WCV_TTHR = 30 [s]
One_Two_far_WCV_TCOA = 3 [s]
One_Two_alert_1_detector = far
One_Two_alert_1_region = MID
One_Two_alert_1_alerting_time = 55 [s]
One_Two_alert_1_early_alerting_time = 75 [s]
One_Two_load_core_detection_near = gov.nasa.larcfm.ACCoRD.WCV_TEP
One_Two_near_WCV_DTHR = 2000 [ft]
One_Two_near_WCV_ZTHR = 120 [m]
One_Two_near_WCV_TTHR = 0 [s]
One_Two_near_WCV_TCOA = 0 [s]
One_Two_alert_2_detector = near
One_Two_alert_2_region = NEAR
One_Two_alert_2_alerting_time = 25 [s]

One_load_core_detection_d = gov.nasa.larcfm.ACCoRD.WCV_TCPA
One_d_WCV_DTHR = 1 [km]
One_d_WCV_ZTHR = 300 [ft]
One_d_WCV_TTHR = 12 [s]
One_alert_1_detector = d
One_alert_1_region = NEAR
One_alert_1_alerting_time = 0.5 [min]
"""
