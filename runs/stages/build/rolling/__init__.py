"""The time loop of a scene: its excitation, time steps, and stopping."""
