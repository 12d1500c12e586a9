"""Networks: what they are trained on, how, and the search for the training's settings. PyTorch is imported here only."""
