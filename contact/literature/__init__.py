"""Contact models of the literature, for comparison: asperities with Hertz springs, wedges with a look-up, fitted springs."""
