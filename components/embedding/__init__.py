"""The chain inside a host simulator that owns time (thesis Appendix A)."""
