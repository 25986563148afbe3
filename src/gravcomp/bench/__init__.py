"""Benchmarks, one module each: `run(progress) -> dict` of figures."""
