"""The static site of reference results, and their page in Markdown."""
