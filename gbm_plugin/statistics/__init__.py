"""Statistics of fibers and turbulence, with errors that know correlation in time."""
