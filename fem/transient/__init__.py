"""Full finite elements in time: the reference that modal runs are held to."""
