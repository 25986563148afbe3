"""References to compare with: beam theories, and CalculiX as a general finite-element program."""
