"""The coupling and its engines judged: by each other, by analytic flows, by averages."""
