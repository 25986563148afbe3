"""Reference solutions: beam theories, and CalculiX as a general finite-element program."""
