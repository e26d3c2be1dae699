"""Contact models of the literature, for comparison: Hertz springs on asperities, wedges, fitted
springs.
"""
