"""Matrices of small motions about a static state, and solutions of them."""
