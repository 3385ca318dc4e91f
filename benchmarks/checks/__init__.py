"""Long checks of the benchmark itself: golden values, endurance, fuzzing."""
