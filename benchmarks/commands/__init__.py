"""What `python -m benchmarks` offers beside `run`."""
