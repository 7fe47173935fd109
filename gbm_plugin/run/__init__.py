"""A scene run, once for each way: OpenFOAM and daemon, the spectral solver, stored fields."""
