"""The parts of `gbm study accuracy`: each module measures one choice of a scene, its error beside its cost.

A part has measure(quick) -> rows, lines(rows) -> text and, where it has a picture, draw(axes, rows); its first line
is its title. Times are processor time of one thread; errors are over the fiber length.
"""
