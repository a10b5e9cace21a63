"""Figures of the pages: `figure` for their content, `svg` and `style` for drawing, and one file for each subject."""
