"""Roads, tread laws, and the unilateral contact problem of a rolling tire."""
