"""Green's functions, receptances and residual flexibility from the modes."""
