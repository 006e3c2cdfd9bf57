"""The workloads, one to a file: a problem in plain arrays, its float64 reference, and one small class per contestant."""
