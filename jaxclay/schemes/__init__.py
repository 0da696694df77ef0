"""Schemes: how unknowns become samples of the contour and weights."""
