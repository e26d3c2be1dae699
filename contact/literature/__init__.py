"""Contact models of the literature for comparison: asperities, wedges, fitted springs."""
