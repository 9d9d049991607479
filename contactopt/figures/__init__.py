"""Plots and pages of solved scenes."""
