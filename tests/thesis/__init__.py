"""The figures and tables of the thesis, recomputed and compared with it (command `reproduce`)."""
