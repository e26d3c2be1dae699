"""From elements to quadrilaterals that carry faces and lines of cords."""
