"""From elements to quadrilaterals with faces and cord lines."""
