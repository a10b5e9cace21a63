"""Figures of the pages: what they show, how it is drawn, and one file for each subject."""
