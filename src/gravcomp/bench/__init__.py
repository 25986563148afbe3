"""Benchmarks, one module each with `run(progress)`, which returns the figures as a dict."""
