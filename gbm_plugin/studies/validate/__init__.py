"""The coupling judged by the spectral solver, by analytic flows and by its own limits: `gbm validate`."""
