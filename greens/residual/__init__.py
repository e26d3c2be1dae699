"""What the modes left out are worth: static and dynamic residual flexibility, and how much is still missing."""
