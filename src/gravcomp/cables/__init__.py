"""Sliding tendons: routes, lengths, forces, and which cables are taut."""
