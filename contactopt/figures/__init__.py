"""Plots and animations of solved scenes."""
