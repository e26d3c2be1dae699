"""This program against full finite elements, closed forms and stress: one module a validation."""
