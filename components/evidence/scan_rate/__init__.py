"""What makes docs/scan-rate.md: the ready study of scan rates, beside what can be computed."""
