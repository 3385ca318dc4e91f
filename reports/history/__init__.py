"""Two results folders compared, before and after, or here and there: what moved beyond noise."""
