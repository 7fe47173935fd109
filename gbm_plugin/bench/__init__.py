"""Benchmarks behind `gbm bench`."""
