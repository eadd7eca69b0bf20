"""Deciders compared in the same traffic: `python -m tractrix.evaluate --help`."""
