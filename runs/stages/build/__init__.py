"""Builds, from the scene, what a stage computes with: tire, air, rotation, contact, time steps."""
