"""The commands of ``windwrench``, a file for each kind of work; they import what they need when
they run.
"""
