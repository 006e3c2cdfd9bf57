"""The workloads, one to a file: a problem in plain arrays, its float64 reference, a small class per contestant."""
