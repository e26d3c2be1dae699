"""Road heights in files: text, NumPy, HDF5 and OpenCRG, read as data and checked before use."""
