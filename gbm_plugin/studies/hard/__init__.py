"""The cases of `gbm study stability`: each module holds those of one part of the program, as a list CASES."""
