"""What is wrong or unlikely with a model, found before it gives wrong numbers."""
