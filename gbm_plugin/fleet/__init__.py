"""All fibers of a scene moved as one, and the journal of their run."""
