"""Other people's parts as blocks: FMUs, processes, recorded measurements, other simulators."""
