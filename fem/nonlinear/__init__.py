"""Large motions: the nonlinear part of the tire's restoring force, and a reduced model of it."""
