"""Training of lane-change policies; wants `pip install "tractrix[train]"` (PyTorch)."""
