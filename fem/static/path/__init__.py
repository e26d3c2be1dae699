"""The path of load steps to the wanted static state."""
