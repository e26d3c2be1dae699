"""Matrices of small motions about a static state, and solutions with them."""
