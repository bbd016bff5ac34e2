"""Alert levels of detect and avoid by the rules and the files of DAIDALUS (RTCA DO-365)."""
