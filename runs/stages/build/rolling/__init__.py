"""The time loop of a scene: how it is driven, in which steps, and when it stops."""
