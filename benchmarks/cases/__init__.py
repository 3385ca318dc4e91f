"""What is mapped: real models, surfaces made in memory, and suites of both."""
